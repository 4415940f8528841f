"""Where the sections of a job are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.vectors import normalise
from damageest.job.sections import LinePlace, SectionChoice

NEAR_AXIS = np.cos(np.radians(2.0))
"""Cosine of the angle to an axis of the part's frame below which a direction is taken to be that axis."""


@dataclass(frozen=True, eq=False)
class Place:
    """A plane through ``origin`` (3,) with unit vectors ``along``, ``out`` and the normal ``across``; or the ``line``
    whose frame it is. ``group``: the number of the item of the job, from 1."""

    name: str
    choice: SectionChoice
    group: int
    origin: Floats
    along: Floats
    out: Floats
    across: Floats
    line: LinePlace | None = None

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Points (N,3) in the plane (N,2), and their distance (N,) from it."""
        local = points - self.origin
        return np.stack([local @ self.along, local @ self.out], axis=1), local @ self.across


def list_places(choices: Sequence[SectionChoice], part: Mesh) -> list[Place]:
    """The places of all sections that a job asks for, in its order."""
    found: list[Place] = []
    for group, choice in enumerate(choices, 1):
        found += _list_of(choice, group, part)
    return found


def _list_of(choice: SectionChoice, group: int, part: Mesh) -> list[Place]:
    for axis in range(3):
        value = getattr(choice, "xyz"[axis])
        if value is not None:
            return [_make(choice, group, value * np.eye(3)[axis], np.eye(3)[axis], f"{'xyz'[axis]} = {value:g}")]
    if choice.plane is not None:
        point = np.array(choice.plane.point)
        at = ", ".join(f"{x:g}" for x in point)
        return [_make(choice, group, point, normalise(np.array([choice.plane.normal]))[0], f"through ({at})")]
    if choice.line is not None:
        start, end = np.array(choice.line.start), np.array(choice.line.end)
        along = normalise((end - start)[None])[0]
        across, out = _make_frame(along)
        return [Place(choice.name or "line", choice, group, start, along, out, across, choice.line)]
    return _list_along(choice, group, part)


def _list_along(choice: SectionChoice, group: int, part: Mesh) -> list[Place]:
    assert choice.along is not None
    axis = find_axis(part, choice.along)
    letter = next(("xyz"[k] for k in range(3) if axis[k] > 1 - 1e-12), "s")
    base = np.zeros(3) if letter != "s" else part.bounds.mean(axis=0)
    heights = part.vertices @ axis
    low, high = float(heights.min()), float(heights.max())
    values = low + (high - low) * np.arange(1, choice.count + 1) / (choice.count + 1)
    if choice.span is not None:
        values = np.linspace(*choice.span, choice.count)
    return [
        _make(choice, group, base + (value - base @ axis) * axis, axis, f"{letter} = {round(float(value), 6):g}")
        for value in values
    ]


def _make(choice: SectionChoice, group: int, origin: Floats, across: Floats, name: str) -> Place:
    along, out = _make_frame(across)
    several = f"{choice.name}, {name}" if choice.along is not None and choice.name else choice.name
    return Place(several or name, choice, group, origin, along, out, across)


def _make_frame(across: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors square to a third, right-handed in this order; x and y for z, and so on in turn."""
    helper = np.eye(3)[(int(np.abs(across).argmax()) + 1) % 3]
    along = normalise((helper - (helper @ across) * across)[None])[0]
    return along, np.cross(across, along)


def find_axis(part: Mesh, along: str | tuple[float, float, float]) -> Floats:
    """The unit vector (3,) of an option `along`. ``axis``: that of a turned part, by its moments of inertia, else that
    in which the part is longest; it points to the positive side of the axis of the frame nearest to it."""
    if not isinstance(along, str):
        return np.asarray(normalise(np.array([along]))[0])
    if along != "axis":
        return np.asarray(np.eye(3)["xyz".index(along)])
    import trimesh

    body = trimesh.Trimesh(part.vertices - part.bounds.mean(axis=0), part.faces, process=False)
    axis = body.symmetry_axis if body.symmetry == "radial" else None
    if axis is None:
        moments, directions = trimesh.inertia.principal_axis(body.moment_inertia)
        axis = directions[int(np.argmin(moments))]
    axis = normalise(np.asarray(axis, np.float64)[None])[0]
    largest = int(np.abs(axis).argmax())
    axis = axis if axis[largest] > 0 else -axis
    snapped: Floats = np.eye(3)[largest]
    return snapped if axis[largest] > NEAR_AXIS else np.asarray(axis)

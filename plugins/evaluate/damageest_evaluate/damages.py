"""Random damages of kinds that occur on used parts. Equal seeds give equal damages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part, Solid
from damageest.errors import StageError
from damageest.geometry.solids import to_manifold
from damageest.geometry.vectors import normalise, to_vector
from damageest.stages.scan.scanner import apply_tools
from damageest.stages.scan.tools import BlobTool, BoxTool, CylinderTool, PlaneTool, SphereTool, Tool
from damageest_evaluate.scores import measure_depth, sample_surface

SHARE = (0.002, 0.33)
"""Least and largest share of the part's volume that a damage removes."""


class PlacePicker:
    """Draws random places and sizes for damages. Sizes are shares of ``size``, which starts as the part's diagonal."""

    def __init__(self, part: Part, rng: np.random.Generator) -> None:
        self.part, self.rng, self.size = part, rng, part.diagonal
        self.points, self.normals = sample_surface(part, 3000)

    def pick_point(self, allowed: Any = None) -> tuple[Floats, Floats]:
        """A random surface point (3,) and its outward normal (3,); only of those ``allowed`` (N,), if given."""
        numbers = np.arange(len(self.points)) if allowed is None else np.flatnonzero(allowed)
        if not len(numbers):
            raise LookupError("the part has no place for this kind of damage")
        k = self.rng.choice(numbers)
        return self.points[k], self.normals[k]

    def draw(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def draw_seed(self) -> int:
        return int(self.rng.integers(1 << 30))

    def draw_rotation(self) -> tuple[float, float, float]:
        """Three random angles in degrees."""
        a, b, c = self.rng.uniform(0, 360, 3)
        return float(a), float(b), float(c)

    @cached_property
    def edge_points(self) -> tuple[Floats, Floats]:
        """Points (M,3) on convex edges sharper than 40 degrees, and the outward bisectors (M,3) of their faces."""
        import trimesh

        mesh = trimesh.Trimesh(self.part.vertices, self.part.faces, process=False)
        sharp = (mesh.face_adjacency_angles > np.radians(40)) & mesh.face_adjacency_convex
        ends = mesh.vertices[mesh.face_adjacency_edges[sharp]]
        out = mesh.face_normals[mesh.face_adjacency[sharp]].sum(1)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        rng = np.random.default_rng(5)
        if not len(length):
            raise LookupError("the part has no sharp edge for this kind of damage")
        k = rng.choice(len(length), 600, p=length / length.sum())
        points = ends[k, 0] + rng.random((600, 1)) * (ends[k, 1] - ends[k, 0])
        return np.asarray(points), normalise(out[k])

    def pick_edge_point(self) -> tuple[Floats, Floats]:
        """A random point (3,) on an edge, and the outward bisector (3,) there."""
        k = self.rng.integers(len(self.edge_points[0]))
        return self.edge_points[0][k], self.edge_points[1][k]

    def _measure_reach(self, sign: float) -> Floats:
        """(N,) distance from each surface point to the next surface, along its normal (sign 1) or against it (-1)."""
        origin = self.part.bounds.mean(0)
        body = to_manifold(self.part, origin)
        start = self.points - origin + sign * 1e-6 * self.size * self.normals
        stop = start + sign * 0.4 * self.size * self.normals
        hits = [body.ray_cast(tuple(a), tuple(b)) for a, b in zip(start, stop, strict=True)]
        return np.array([0.4 * self.size * min((h.distance for h in hit), default=9.0) for hit in hits])

    @cached_property
    def thickness(self) -> Floats:
        """(N,) thickness of the wall below each surface point."""
        return self._measure_reach(-1)

    @cached_property
    def gap(self) -> Floats:
        """(N,) width of the gap above each surface point."""
        return self._measure_reach(1)


def _make_lump(picker: PlacePicker, centre: Floats, radius: float) -> Tool:
    """A ball or a blob."""
    if picker.rng.random() < 0.3:
        return SphereTool(centre=to_vector(centre), radius=radius)
    return BlobTool(centre=to_vector(centre), radius=radius, seed=picker.draw_seed())


def make_chip(picker: PlacePicker) -> list[Tool]:
    """A chip broken off an edge or a corner: a ball or blob, or a rough plane."""
    point, out = picker.pick_edge_point()
    if picker.rng.random() < 0.6:
        return [_make_lump(picker, point, picker.size * picker.draw(0.04, 0.13))]
    tilt = out + 0.25 * picker.rng.normal(size=3)
    tilt /= np.linalg.norm(tilt)
    depth, within = picker.size * picker.draw(0.015, 0.05), picker.size * picker.draw(0.08, 0.2)
    rough = picker.size * picker.draw(0.0005, 0.003)
    return [
        PlaneTool(
            point=to_vector(point - depth * tilt),
            normal=to_vector(tilt),
            within=within,
            roughness=rough,
            seed=picker.draw_seed(),
        )
    ]


def make_pit(picker: PlacePicker) -> list[Tool]:
    """A pit in a face, deeper than a quarter of its width."""
    point, normal = picker.pick_point()
    radius = picker.size * picker.draw(0.04, 0.12)
    return [_make_lump(picker, point + picker.draw(-0.1, 0.5) * radius * normal, radius)]


def make_cut(picker: PlacePicker) -> list[Tool]:
    """A box or a wedge cut out of an edge or a face."""
    point = (picker.pick_edge_point() if picker.rng.random() < 0.7 else picker.pick_point())[0]
    a, b, c = picker.size * picker.rng.uniform(0.06, 0.22, 3)
    rough = picker.size * picker.draw(0.0005, 0.002) if picker.rng.random() < 0.4 else 0.0
    return [
        BoxTool(
            centre=to_vector(point),
            size=(float(a), float(b), float(c)),
            rotation=picker.draw_rotation() if picker.rng.random() < 0.6 else (0.0, 0.0, 0.0),
            roughness=rough,
            seed=picker.draw_seed(),
        )
    ]


def break_off_end(picker: PlacePicker) -> list[Tool]:
    """An end broken off, 5 to 30 % of the volume."""
    origin = picker.part.bounds.mean(0)
    body = to_manifold(picker.part, origin)
    if picker.rng.random() < 0.6:
        normal = picker.rng.choice([-1.0, 1.0]) * np.eye(3)[picker.rng.integers(3)] + 0.15 * picker.rng.normal(size=3)
    else:
        normal = picker.rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    wanted = picker.draw(0.05, 0.3) * picker.part.volume
    low, high = -picker.size, picker.size
    for _ in range(40):
        offset = (low + high) / 2
        taken = body.trim_by_plane(to_vector(normal), offset).volume()
        low, high = (offset, high) if taken > wanted else (low, offset)
    rough = picker.size * picker.draw(0, 0.004)
    return [
        PlaneTool(
            point=to_vector(origin + offset * normal),
            normal=to_vector(normal),
            roughness=rough,
            seed=picker.draw_seed(),
        )
    ]


def make_hole(picker: PlacePicker) -> list[Tool]:
    """A round through hole, nearly square to the surface."""
    point, normal = picker.pick_point()
    axis = -normal + 0.15 * picker.rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    radius = picker.size * picker.draw(0.025, 0.06)
    back = 0.05 * picker.size
    return [
        CylinderTool(point=to_vector(point - back * axis), axis=to_vector(axis), radius=radius, length=3 * picker.size)
    ]


def wear_through(picker: PlacePicker) -> list[Tool]:
    """A hole worn through a thin wall by a round body, with a rim on either side."""
    wall = picker.thickness
    thin = np.flatnonzero(wall < 0.12 * picker.size)
    if not len(thin):
        raise LookupError("the part has no thin wall")
    k = picker.rng.choice(thin)
    radius = max(wall[k], 0.02 * picker.size) * picker.draw(1.1, 2.0)
    middle = picker.points[k] + (radius - 1.25 * wall[k]) * picker.normals[k] * picker.draw(0.0, 0.8)
    return [_make_lump(picker, middle, float(radius))]


def make_groove(picker: PlacePicker) -> list[Tool]:
    """A long, narrow groove in a face, with open or closed ends."""
    point, normal = picker.pick_point()
    along = np.cross(normal, picker.rng.normal(size=3))
    along /= np.linalg.norm(along)
    depth, width = picker.size * picker.draw(0.015, 0.05), picker.size * picker.draw(0.02, 0.06)
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(np.column_stack([along, np.cross(normal, along), normal])).as_euler("xyz", degrees=True)
    size = (picker.size * picker.draw(0.25, 0.7), width, 2 * depth)
    return [BoxTool(centre=to_vector(point), size=size, rotation=to_vector(turn))]


def make_damage_beside_gap(picker: PlacePicker) -> list[Tool]:
    """A ball or blob out of a wall that is close to another wall: in a bore, between teeth, in a slot."""
    point, normal = picker.pick_point(picker.gap < 0.15 * picker.size)
    radius = picker.size * picker.draw(0.04, 0.1)
    return [_make_lump(picker, point - picker.draw(0.0, 0.5) * radius * normal, radius)]


def make_touching_pair(picker: PlacePicker) -> list[Tool]:
    """Two balls or blobs whose rims touch or overlap, or that are separated by a thin web of intact surface."""
    point, normal = picker.pick_edge_point() if picker.rng.random() < 0.3 else picker.pick_point()
    radii = picker.size * picker.rng.uniform(0.04, 0.09, 2)
    gap = radii.sum() * picker.draw(0.75, 1.05)
    off = picker.points - point
    level = np.abs(np.linalg.norm(off, axis=1) - gap)
    other = picker.rng.choice(np.argsort(level, kind="stable")[:40])
    first = point - picker.draw(-0.3, 0.3) * radii[0] * normal
    second = picker.points[other] - picker.draw(-0.3, 0.3) * radii[1] * picker.normals[other]
    return [_make_lump(picker, first, float(radii[0])), _make_lump(picker, second, float(radii[1]))]


KINDS: dict[str, Callable[[PlacePicker], list[Tool]]] = {
    "chip": make_chip,
    "pit": make_pit,
    "cut": make_cut,
    "end": break_off_end,
    "hole": make_hole,
    "worn_through": wear_through,
    "groove": make_groove,
    "beside_gap": make_damage_beside_gap,
    "touching": make_touching_pair,
}
"""Name of a kind of damage: the function that makes one at random."""


@dataclass(frozen=True, eq=False)
class RandomDamage:
    """``tools``: option ``damage`` of `scan: simulate`; ``kinds``: one for each damage; ``damage``: the true volume."""

    tools: tuple[Tool, ...]
    kinds: tuple[str, ...]
    damage: Solid


def make_random_damage(part: Part, seed: int, kinds: tuple[str, ...] = (), count: int | None = None) -> RandomDamage:
    """One to three damages on a part, each as deep as `find_least_depth`, and together within ``SHARE``.

    ``kinds``: of the first damages; the others are random. ``count``: how many; None: random. If the part has no place
    for a kind, another kind replaces it. Raises LookupError if no damage fits.
    """
    rng = np.random.default_rng([6173, seed])
    picker = PlacePicker(part, rng)
    wanted = count or max(len(kinds), int(rng.choice([1, 2, 3], p=[0.6, 0.25, 0.15])))
    tools: list[Tool] = []
    names: list[str] = []
    damage: Solid | None = None
    for number in range(wanted):
        name = kinds[number] if number < len(kinds) else str(rng.choice(list(KINDS)))
        for attempt in range(60):
            if attempt and attempt % 20 == 0:
                name = str(rng.choice(list(KINDS)))
            found = _try_damage(picker, name, tools)
            if found is not None:
                tools, damage = found
                names.append(name)
                break
    if damage is None:
        raise LookupError(f"no damage fits the part with seed {seed}")
    return RandomDamage(tuple(tools), tuple(names), damage)


def find_least_depth(part: Part) -> float:
    """The least depth of a damage: 0.008 of the diagonal; on a thin wall, most of what lies between its two sides."""
    wall = 2 * part.volume / part.face_areas.sum()
    return float(min(0.008 * part.diagonal, 0.9 * wall / 2))


def _try_damage(picker: PlacePicker, name: str, before: list[Tool]) -> tuple[list[Tool], Solid] | None:
    """The tools with one more damage, and the volume of all; None if it is too small, too large or does not fit."""
    part = picker.part
    try:
        more = KINDS[name](picker)
        alone = apply_tools(part, more)[1]
        if alone is None or not SHARE[0] * part.volume < alone.volume < SHARE[1] * part.volume:
            return None
        if measure_depth(alone, part) < find_least_depth(part):
            return None
        tools = [*before, *more]
        damage = apply_tools(part, tools)[1] if before else alone
    except (StageError, LookupError):
        return None
    return None if damage is None or damage.volume > SHARE[1] * part.volume else (tools, damage)

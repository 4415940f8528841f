"""A part that is bent, twisted, scaled, tapered or deformed at random before it is scanned."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydantic import ConfigDict, Field, FiniteFloat

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.refinement import cut_into_cells
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.transforms import remove_rigid
from damageest.options import Options
from damageest.stages.scan._random_field import RandomField
from damageest.stages.scan.tools import Direction

SAMPLES = 4000
"""Points of the skin that the amount of a deformation is measured with."""
FINE = 80.0
"""Triangles along the part's diagonal at least, of a solid that is deformed with it."""


class Deformation(Options):
    """The deformation of a part. Amounts are the largest displacement of its skin beyond the nearest rigid motion
    (least squares over the skin), in the job's unit."""

    model_config = ConfigDict(defer_build=True)
    bend: FiniteFloat = Field(0.0, description="amount by which its axis is bent to an arc")
    twist: FiniteFloat = Field(0.0, description="amount by which its cross-sections are turned about its axis")
    scale: FiniteFloat = Field(0.0, description="amount by which it is larger all over; negative: smaller")
    stretch: FiniteFloat = Field(
        0.0, description="amount by which it is longer along the axis alone; negative: shorter"
    )
    taper: FiniteFloat = Field(
        0.0, description="amount by which cross-sections grow along the axis: smaller at one end, larger at the other"
    )
    free: FiniteFloat = Field(0.0, ge=0, description="amount of a smooth random displacement")
    cells: int = Field(3, ge=1, le=10, description="waves of `free` along the longest edge of the box")
    seed: int = Field(0, ge=0, description="seed of `free`")
    along: Direction | None = Field(None, description="direction of the axis; default: the longest edge of its box")
    toward: Direction | None = Field(
        None, description="direction that the ends are bent to; default: the shortest edge of its box"
    )


def deform(points: Floats, how: Deformation, part: Mesh) -> Floats:
    """The points (N,3) of a part, deformed about its centre, in the order of the options."""
    centre = part.bounds.mean(axis=0)
    frame = _choose_axes(how, part)
    skin = (sample_by_area(part, SAMPLES, np.random.default_rng(5))[0] - centre) @ frame.T
    q = (points - centre) @ frame.T
    if how.free:
        q = q + how.free * _make_free(how, skin)(q)
    for amount, move in ((how.taper, _taper), (how.stretch, _stretch), (how.scale, _scale)):
        if amount:
            q = move(q, amount / _measure_unit(skin, move))
    if how.twist:
        q = _twist(q, how.twist / _measure_unit(skin, _twist))
    if how.bend:
        q = _bend(q, how.bend / _measure_unit(skin, _bend))
    return np.asarray(q @ frame + centre)


def deform_solid(solid: Solid, how: Deformation, part: Mesh) -> Solid:
    """A solid of the part, deformed with it: cut so finely that its triangles follow."""
    fine, _ = cut_into_cells(solid, min(part.diagonal / FINE, max(solid.diagonal / 20, part.diagonal / (4 * FINE))))
    return Solid(deform(fine.vertices, how, part), fine.faces)


def _choose_axes(how: Deformation, part: Mesh) -> Floats:
    """The axis, the direction of bending, and the third direction, as rows (3,3)."""
    size = np.ptp(part.bounds, axis=0)
    axis = np.eye(3)[int(np.argmax(size))] if how.along is None else np.array(how.along, dtype=np.float64)
    axis /= np.linalg.norm(axis)
    thin = np.eye(3)[min((k for k in range(3) if abs(axis[k]) < 0.9), key=lambda k: float(size[k]))]
    toward = thin if how.toward is None else np.array(how.toward, dtype=np.float64)
    toward = toward - (toward @ axis) * axis
    toward /= np.linalg.norm(toward)
    return np.stack([axis, toward, np.cross(axis, toward)])


def _bend(q: Floats, curvature: float) -> Floats:
    """The axis becomes an arc of a circle, and cross-sections stay plane and at right angles to it."""
    angle = curvature * q[:, 0]
    along = np.sinc(angle / np.pi) * q[:, 0] - q[:, 1] * np.sin(angle)
    up = q[:, 0] * np.sinc(angle / (2 * np.pi)) * np.sin(angle / 2) + q[:, 1] * np.cos(angle)
    return np.stack([along, up, q[:, 2]], axis=1)


def _twist(q: Floats, rate: float) -> Floats:
    """Cross-sections turn by an angle that is proportional to their place along the axis."""
    cos, sin = np.cos(rate * q[:, 0]), np.sin(rate * q[:, 0])
    return np.stack([q[:, 0], cos * q[:, 1] - sin * q[:, 2], sin * q[:, 1] + cos * q[:, 2]], axis=1)


def _scale(q: Floats, share: float) -> Floats:
    return q * (1 + share)


def _stretch(q: Floats, share: float) -> Floats:
    return np.asarray(q * np.array([1 + share, 1.0, 1.0]))


def _taper(q: Floats, slope: float) -> Floats:
    """Cross-sections are larger by a share that is proportional to their place along the axis."""
    return np.stack([q[:, 0], q[:, 1] * (1 + slope * q[:, 0]), q[:, 2] * (1 + slope * q[:, 0])], axis=1)


def _make_free(how: Deformation, skin: Floats) -> Callable[[Floats], Floats]:
    """A random displacement of amount 1: a sum of waves."""
    size = float(np.ptp(skin, axis=0).max())
    waves = [RandomField.build(size / how.cells, 1, 3 * how.seed + axis + 1, waves=6) for axis in range(3)]

    def displace(q: Floats) -> Floats:
        return np.stack([wave.evaluate(q) for wave in waves], axis=1)

    moved = remove_rigid(skin, displace(skin), np.ones(len(skin)))
    largest = float(np.linalg.norm(moved, axis=1).max())
    return lambda q: displace(q) / largest


def _measure_unit(skin: Floats, move: object) -> float:
    """The amount per unit of curvature or rate, for a small one."""
    small = 1e-5 / float(np.abs(skin).max())
    moved = remove_rigid(skin, move(skin, small) - skin, np.ones(len(skin)))  # type: ignore[operator]
    return float(np.linalg.norm(moved, axis=1).max()) / small

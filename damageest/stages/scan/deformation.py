"""A part that is bent or twisted before it is scanned."""

from __future__ import annotations

import numpy as np
from pydantic import ConfigDict, Field, FiniteFloat

from damageest.artefacts import Floats, Mesh
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.transforms import remove_rigid
from damageest.options import Options
from damageest.stages.scan.tools import Direction

SAMPLES = 4000
"""Points of the skin that the amount of a deformation is measured with."""


class Deformation(Options):
    """How a part is deformed. Amounts are the largest displacement of its skin beyond the nearest rigid motion (least
    squares over the skin), in the job's unit."""

    model_config = ConfigDict(defer_build=True)
    bend: FiniteFloat = Field(0.0, description="amount by which its axis is bent to an arc")
    twist: FiniteFloat = Field(0.0, description="amount by which its cross-sections are turned about its axis")
    along: Direction | None = Field(None, description="direction of the axis; default: the longest edge of its box")
    toward: Direction | None = Field(
        None, description="direction that the ends are bent to; default: the shortest edge of its box"
    )


def deform(points: Floats, how: Deformation, part: Mesh) -> Floats:
    """The points (N,3) of a part, bent and twisted about its centre."""
    centre = part.bounds.mean(axis=0)
    frame = _choose_axes(how, part)
    skin = (sample_by_area(part, SAMPLES, np.random.default_rng(5))[0] - centre) @ frame.T
    q = (points - centre) @ frame.T
    if how.twist:
        q = _twist(q, how.twist / _measure_unit(skin, _twist))
    if how.bend:
        q = _bend(q, how.bend / _measure_unit(skin, _bend))
    return np.asarray(q @ frame + centre)


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


def _measure_unit(skin: Floats, move: object) -> float:
    """The amount per unit of curvature or rate, for a small one."""
    small = 1e-5 / float(np.abs(skin).max())
    moved = remove_rigid(skin, move(skin, small) - skin, np.ones(len(skin)))  # type: ignore[operator]
    return float(np.linalg.norm(moved, axis=1).max()) / small

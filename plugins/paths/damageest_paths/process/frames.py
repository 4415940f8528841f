"""Frames of a build direction: local coordinates whose z is the build direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from damageest.artefacts import Floats


def make_unit(vector: ArrayLike) -> Floats:
    """The vector (3,) with length 1. Raises ValueError for one without length."""
    found = np.asarray(vector, dtype=np.float64)
    length = float(np.linalg.norm(found))
    if not length > 0:
        raise ValueError("a direction needs a length above 0")
    return np.asarray(found / length)


def find_across(direction: Floats) -> Floats:
    """A unit vector (3,) at right angles to ``direction`` (3,), from the axis that is most across it."""
    axis = np.zeros(3)
    axis[int(np.argmin(np.abs(np.round(direction, 9))))] = 1.0
    return make_unit(axis - axis @ direction * direction)


@dataclass(frozen=True, eq=False)
class Frame:
    """Local coordinates: ``turn`` (3,3) has the local axes as rows, the last the build direction; ``origin`` (3,)."""

    turn: Floats
    origin: Floats

    @property
    def direction(self) -> Floats:
        """(3,) the build direction."""
        return np.asarray(self.turn[2])

    def to_local(self, points: Floats) -> Floats:
        """Points (N,3) of the part's frame in local coordinates."""
        return np.asarray((points - self.origin) @ self.turn.T)

    def to_part(self, points: Floats) -> Floats:
        """Local points (N,3) in the part's frame."""
        return np.asarray(points @ self.turn + self.origin)

    def move(self, body: Any) -> Any:
        """A Manifold whose coordinates are relative to ``origin``, turned into local coordinates."""
        return body.transform(np.hstack([self.turn, np.zeros((3, 1))]))


def make_frame(direction: ArrayLike, origin: Floats) -> Frame:
    """The frame of a build ``direction`` (3,) about ``origin`` (3,). Raises ValueError for one without length."""
    z = make_unit(direction)
    x = find_across(z)
    return Frame(np.array([x, np.cross(z, x), z]), np.asarray(origin, dtype=np.float64))

"""The nozzle as a solid of revolution, and as a mesh for distances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest_paths.tool.trees import make_tree

SIDES = 32
"""Corners of the mesh's outline. They lie outside the circle, so that the mesh holds the nozzle."""


@dataclass(frozen=True)
class Cone:
    """A nozzle: a flat tip, a cone that widens from it, and a cylindrical body.

    ``tip_radius``, ``body_radius``, ``length``: lengths; the length is that of the whole, from the tip. ``angle``: in
    radians, between the axis and the side of the cone.
    """

    tip_radius: float
    body_radius: float
    length: float
    angle: float

    def draw_profile(self) -> Floats:
        """Height above the tip and radius (K,2), from the tip upward."""
        rise = (self.body_radius - self.tip_radius) / np.tan(self.angle) if self.angle > 0 else np.inf
        if rise >= self.length:
            return np.array([[0, self.tip_radius], [self.length, self.tip_radius + self.length * np.tan(self.angle)]])
        return np.array([[0, self.tip_radius], [rise, self.body_radius], [self.length, self.body_radius]])


@dataclass(frozen=True, eq=False)
class Nozzle:
    """``mesh``: closed, tip at 0, axis along z. ``profile`` (K,2): height and radius of a solid of revolution that
    holds it, None for another mesh."""

    mesh: Mesh
    profile: Floats | None = None

    @cached_property
    def object(self) -> Any:
        """The mesh as FCL's object, which is moved from pose to pose."""
        import fcl

        return fcl.CollisionObject(make_tree(self.mesh), fcl.Transform())


def make_nozzle(cone: Cone) -> Nozzle:
    """The nozzle of a cone. Its profile has the radius of the mesh's corners, so that it holds the mesh."""
    profile = cone.draw_profile()
    if len(profile) == 3 and profile[1, 0] <= 1e-9 * cone.length:  # no cone: the tip is as wide as the body
        profile = np.array([[0.0, cone.body_radius], [cone.length, cone.body_radius]])
    return Nozzle(make_nozzle_mesh(cone), profile * [1.0, 1 / np.cos(np.pi / SIDES)])


def make_nozzle_mesh(cone: Cone) -> Mesh:
    """The nozzle as a closed mesh that holds it: tip at 0, axis along z. It is wider by 0.5 % of the radius at most."""
    profile = cone.draw_profile()
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) / np.cos(np.pi / SIDES)
    rings = [np.column_stack([radius * circle, np.full(SIDES, height)]) for height, radius in profile]
    ends = np.array([[0, 0, profile[0, 0]], [0, 0, profile[-1, 0]]])
    near = np.arange(SIDES)
    following = (near + 1) % SIDES
    faces = []
    for k in range(len(rings) - 1):
        a, b = near + k * SIDES, following + k * SIDES
        faces += [np.stack([a, b, b + SIDES], axis=1), np.stack([a, b + SIDES, a + SIDES], axis=1)]
    low, last = len(rings) * SIDES, (len(rings) - 1) * SIDES
    faces.append(np.stack([np.full(SIDES, low), following, near], axis=1))
    faces.append(np.stack([np.full(SIDES, low + 1), near + last, following + last], axis=1))
    return Mesh(np.concatenate([*rings, ends]), np.concatenate(faces))

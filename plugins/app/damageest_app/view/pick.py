"""Where a click meets the part or the scan: on the full data, not on what the browser draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.vectors import normalise

NEAR = 0.01
"""Largest angle, in radians, between a ray and what it picks: a few pixels."""


@dataclass(frozen=True, eq=False)
class Ray:
    """A ray of the view from ``origin`` (3,) in unit ``direction`` (3,)."""

    origin: Floats
    direction: Floats

    @classmethod
    def of_click(cls, click: dict[str, Any]) -> Ray:
        """``click``: ``x`` and ``y`` from -1 to 1 (right and up), ``aspect``, and the camera as vtk.js gives it."""
        camera = click["camera"]
        origin, focal, up = (np.array(camera[name], float) for name in ("position", "focalPoint", "viewUp"))
        ahead = focal - origin
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, up)
        right /= np.linalg.norm(right)
        top = np.cross(right, ahead)
        slope = np.tan(np.radians(float(camera["viewAngle"])) / 2)
        way = ahead + slope * (float(click["x"]) * float(click["aspect"]) * right + float(click["y"]) * top)
        return cls(origin, way / np.linalg.norm(way))

    def move(self, offset: Floats) -> Ray:
        """The ray as seen from things that are shown moved by ``offset``."""
        return Ray(self.origin - offset, self.direction)


class MeshPicker:
    """Finds where clicks meet a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self._caster = RayCaster(mesh)

    def find(self, ray: Ray) -> tuple[Floats, int] | None:
        """Place (3,) and triangle that a ray meets, or one a few pixels beside it, so that edges and corners can be
        clicked; None where it meets nothing."""
        ways = _surround(ray.direction)
        distance, face = self._caster.find_first(np.tile(ray.origin, (len(ways), 1)), ways)
        met = np.flatnonzero(face >= 0)
        if not len(met):
            return None
        return ray.origin + distance[met[0]] * ways[met[0]], int(face[met[0]])


def _surround(direction: Floats) -> Floats:
    """(41,3) unit directions: the one given, then rings about it of growing angle up to `NEAR`."""
    side = np.cross(direction, np.eye(3)[int(np.abs(direction).argmin())])
    side /= np.linalg.norm(side)
    turn = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(direction, side)
    ways = np.concatenate([direction[None], *(direction + NEAR * share * ring for share in (0.1, 0.2, 0.35, 0.6, 1))])
    return normalise(ways)


def find_point(points: Floats, ray: Ray) -> int | None:
    """The point (N,3) of the scan that a ray picks: of those within a few pixels of it, the one in front."""
    local = points - ray.origin
    along = local @ ray.direction
    off = np.linalg.norm(local - along[:, None] * ray.direction, axis=1)
    angle = np.where(along > 0, off / np.maximum(along, 1e-300), np.inf)
    near = np.flatnonzero(angle < NEAR)
    if not len(near):
        return None
    front = along[near] < along[near].min() * 1.02
    return int(near[front][angle[near[front]].argmin()])

"""A blade and a shaft whose chord, thickness, twist, bow, diameter and run-out are known, and scans of them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import trimesh

from damageest.artefacts import Floats, Mesh, Part

HEIGHT = 90.0
"""mm from the root of the blade to its tip, along z."""


@dataclass(frozen=True)
class Blade:
    """An aerofoil (NACA four digits) lofted along z. ``twist`` in degrees at root and tip; ``bow`` in mm across the
    chord in the middle of the height, 0 at its ends; ``shift`` in mm across the chord of each place."""

    chord: float = 40.0
    thickness: float = 4.8
    camber: float = 0.05
    twist: tuple[float, float] = (10.0, 30.0)
    bow: float = 0.0
    tail: float = 0.8

    def angle(self, z: float) -> float:
        """Angle of the chord at a height, in degrees."""
        return self.twist[0] + (self.twist[1] - self.twist[0]) * z / HEIGHT

    def bowed(self, z: float) -> float:
        """How far the section at a height is moved across its chord."""
        return self.bow * 4 * z / HEIGHT * (1 - z / HEIGHT)

    def outline(self, z: float, count: int = 90) -> Floats:
        """(2 * count, 2) counter-clockwise, the lower side from the leading to the trailing edge first."""
        x = (1 - np.cos(np.linspace(0, np.pi, count))) / 2
        share = self.thickness / self.chord
        half = 5 * share * (0.2969 * x**0.5 - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
        half += self.tail / self.chord / 2 * x
        line = self.camber * 4 * x * (1 - x)
        slope = np.arctan(self.camber * 4 * (1 - 2 * x))
        side = half[:, None] * np.column_stack([-np.sin(slope), np.cos(slope)])
        middle = np.column_stack([x - 0.5, line])
        flat = np.concatenate([middle - side, (middle + side)[::-1]]) * self.chord
        flat[:, 1] += self.bowed(z)
        cosine, sine = np.cos(np.radians(self.angle(z))), np.sin(np.radians(self.angle(z)))
        return np.asarray(flat @ np.array([[cosine, sine], [-sine, cosine]]))

    def part(self, rings: int = 61, count: int = 90) -> Part:
        """The blade as a solid."""
        heights = np.linspace(0, HEIGHT, rings)
        size = 2 * count
        vertices = np.concatenate([np.column_stack([self.outline(z, count), np.full(size, z)]) for z in heights])
        own = np.arange(size)
        other = (own + 1) % size
        faces = []
        for low, high in pairwise(np.arange(rings) * size):
            faces += [np.column_stack([low + own, low + other, high + other])]
            faces += [np.column_stack([low + own, high + other, high + own])]
        upper = size - 1 - np.arange(count)
        k = np.arange(count - 1)
        cap = np.concatenate([np.column_stack([k, upper[k], k + 1]), np.column_stack([k + 1, upper[k], upper[k + 1]])])
        faces += [cap, cap[:, ::-1] + (rings - 1) * size]
        mesh = trimesh.Trimesh(vertices, np.concatenate(faces), process=True)
        mesh.merge_vertices()
        mesh.update_faces(mesh.nondegenerate_faces())
        return Part(mesh.vertices, mesh.faces)


def scan_mesh(part: Mesh, spacing: float, noise: float, seed: int = 0) -> Floats:
    """Points (N,3) evenly over a mesh, about ``spacing`` apart, moved along its normals by ``noise``."""
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    points, face = trimesh.sample.sample_surface(mesh, int(mesh.area / spacing**2), seed=seed)
    away = np.random.default_rng(seed).normal(0, noise, len(points))
    return np.asarray(points + away[:, None] * mesh.face_normals[face])

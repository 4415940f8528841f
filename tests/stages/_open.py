"""Open surfaces of revolution, as damage leaves them, for the tests of the surface route."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Surface


def revolved(profile: Floats, sections: int = 96, inward: bool = True) -> Surface:
    """The profile (K,2) of radius and height turned about z; a radius of 0 at its start closes it there.

    Wound so that a profile running upward has its normals toward the axis.
    """
    angle = 2 * np.pi * np.arange(sections) / sections
    closed = profile[0, 0] == 0
    rings = profile[1:] if closed else profile
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.concatenate(
        [np.concatenate([radius * circle, np.full((sections, 1), height)], axis=1) for radius, height in rings]
    )
    i = np.arange(sections)
    j = (i + 1) % sections
    faces = []
    for k in range(len(rings) - 1):
        a, b = k * sections, (k + 1) * sections
        faces += [np.stack([a + i, b + i, a + j], axis=1), np.stack([a + j, b + i, b + j], axis=1)]
    if closed:
        vertices = np.concatenate([vertices, [[0.0, 0.0, profile[0, 1]]]])
        faces.append(np.stack([np.full(sections, len(vertices) - 1), i, j], axis=1))
    stacked = np.concatenate(faces)
    return Surface(vertices, stacked if inward else stacked[:, ::-1])


def bowl(radius: float, top: float, short: float) -> Surface:
    """The lower half of a ball centred at height ``top``, its rim ``short`` below that height; normals upward."""
    end = np.pi / 2 - np.arcsin(short / radius)
    polar = np.linspace(0, end, 30)
    return revolved(np.stack([radius * np.sin(polar), top - radius * np.cos(polar)], axis=1))


def pipe(radius: float, low: float, high: float) -> Surface:
    """The wall of a hole, open at both ends; normals toward its axis."""
    height = np.linspace(low, high, 30)
    return revolved(np.stack([np.full(30, radius), height], axis=1))

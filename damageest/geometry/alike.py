"""Whether two solids have the same shape, wherever they lie."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Solid

VOLUMES, EXTENTS = 1.1, 1.12
"""Largest ratio of the volumes, and of each of the three principal radii of gyration, of solids of one shape."""


def have_same_shape(first: Solid, second: Solid) -> bool:
    """Whether two solids in one unit, in any frames, have the same size and proportions; mirror images have."""
    if not 1 / VOLUMES < first.volume / second.volume < VOLUMES:
        return False
    ratio = measure_radii(first) / np.maximum(measure_radii(second), 1e-300)
    return bool(((ratio > 1 / EXTENTS) & (ratio < EXTENTS)).all())


def measure_radii(solid: Solid) -> Floats:
    """The principal radii of gyration (3,) of a solid about its centre of mass, ascending."""
    import trimesh

    inertia = trimesh.Trimesh(solid.vertices - solid.bounds.mean(axis=0), solid.faces, process=False).moment_inertia
    spread = (np.trace(inertia) / 2 * np.eye(3) - inertia) / solid.volume
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(spread), 0.0)))

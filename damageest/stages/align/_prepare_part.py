"""What an alignment computes from the part alone. A process that aligns many scans of one part computes it once."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, field

import numpy as np

from damageest.artefacts import Mesh
from damageest.stages.align._field import PartSurface, PlaneGrid
from damageest.stages.align._pairs import PairTable
from damageest.stages.align._points import orient_surface

MOST_KEPT = 200_000
"""Number of triangles up to which the part's data is kept for the next scan: beyond it they would take memory from
the stages that follow."""
SURFACE_POINTS = 20_000
"""Number of points on the part that the pairs are drawn from."""


@dataclass(frozen=True)
class PreparedPart:
    """A part centred and scaled to a diagonal of 1: its surface, the grid of planes, and the table of its pairs."""

    surface: PartSurface
    grid: PlaneGrid
    pairs: PairTable


@dataclass(frozen=True)
class _Asked:
    """A mesh that is compared by the digest of its arrays."""

    digest: bytes
    seed: int
    surface: PartSurface = field(compare=False)


def prepare_part(surface: PartSurface, seed: int) -> PreparedPart:
    """The data of a part, from the last call where the mesh and the seed are the same."""
    asked = _Asked(_digest(surface.mesh), seed, surface)
    if len(surface.mesh.faces) > MOST_KEPT:
        return _prepare(asked)
    return _prepare_once(asked)


def _prepare(asked: _Asked) -> PreparedPart:
    surface, rng = asked.surface, np.random.default_rng([asked.seed, 1])
    points = orient_surface(surface.mesh, SURFACE_POINTS, rng)
    return PreparedPart(surface, PlaneGrid.build(surface), PairTable.build(points, rng))


_prepare_once = functools.lru_cache(maxsize=1)(_prepare)


def _digest(mesh: Mesh) -> bytes:
    found = hashlib.blake2b(digest_size=16)
    for array in (mesh.vertices, mesh.faces):
        found.update(np.ascontiguousarray(array).data)
    return found.digest()

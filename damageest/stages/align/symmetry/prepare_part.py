"""What an alignment computes from the part alone: once for all scans of one part, also in later runs."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass, field

import numpy as np

from damageest.artefacts import Floats
from damageest.io.part_store import Arrays, recall
from damageest.stages.align.search.pairs import PairTable
from damageest.stages.align.surface.oriented_points import OrientedPoints, orient_surface
from damageest.stages.align.surface.plane_grid import PartSurface, PlaneGrid
from damageest.stages.align.symmetry.symmetries import find_symmetries, is_mirrored_onto_itself

MOST_KEPT = 200_000
"""Number of triangles up to which the part's data is kept for the next scan: beyond it they would take memory from
the stages that follow."""
SURFACE_POINTS = 20_000
"""Number of points on the part that the pairs are drawn from."""


@dataclass(frozen=True, eq=False)
class PreparedPart:
    """A part centred and scaled to a diagonal of 1: its surface, the grid of planes, and the table of its pairs.
    ``key``: digest of the part and the seed."""

    surface: PartSurface
    grid: PlaneGrid
    pairs: PairTable
    seed: int
    key: str

    @functools.cached_property
    def symmetries(self) -> Floats:
        """The part's symmetries (G,4,4), the identity first; found when they are asked for."""

        def find() -> Arrays:
            return {"motions": find_symmetries(self.surface, self.grid, self.pairs, self.seed)}

        return np.asarray(recall("symmetries", self.key, find)["motions"])

    @functools.cached_property
    def is_mirror_symmetric(self) -> bool:
        """Whether a plane mirrors the part onto itself; found when it is asked for."""

        def find() -> Arrays:
            return {"is": np.array(is_mirrored_onto_itself(self.surface, self.grid, self.seed))}

        return bool(recall("mirror", self.key, find)["is"])


@dataclass(frozen=True)
class _Asked:
    """A mesh that is compared by the digest of its arrays."""

    digest: str
    seed: int
    surface: PartSurface = field(compare=False)


def prepare_part(surface: PartSurface, seed: int) -> PreparedPart:
    """The data of a part, from the last call or an earlier run where the mesh and the seed are the same."""
    asked = _Asked(_digest(surface), seed, surface)
    if len(surface.mesh.faces) > MOST_KEPT:
        return _prepare(asked)
    return _prepare_once(asked)


def _prepare(asked: _Asked) -> PreparedPart:
    key = f"{asked.digest} {asked.seed}"
    grid, pairs = _unpack(recall("align", key, lambda: _compute(asked)))
    return PreparedPart(asked.surface, grid, pairs, asked.seed, key)


_prepare_once = functools.lru_cache(maxsize=1)(_prepare)


def _compute(asked: _Asked) -> Arrays:
    """The grid and the table of pairs as arrays, in types that take little space."""
    surface, rng = asked.surface, np.random.default_rng([asked.seed, 1])
    points = orient_surface(surface.known, SURFACE_POINTS, rng)
    grid, pairs = PlaneGrid.build(surface, points), PairTable.build(points, rng)
    return {
        "low": grid.low, "cell": np.array(grid.cell), "shape": np.array(grid.shape),
        "plane": grid.plane, "distance": grid.distance,
        "points": pairs.points.points, "normals": pairs.points.normals,
        "i": pairs.i.astype(np.uint16), "j": pairs.j.astype(np.uint16), "key": pairs.key.astype(np.int32),
    }  # fmt: skip


def _unpack(arrays: Arrays) -> tuple[PlaneGrid, PairTable]:
    x, y, z = (int(size) for size in arrays["shape"])
    grid = PlaneGrid(arrays["low"], float(arrays["cell"]), (x, y, z), arrays["plane"], arrays["distance"])
    points = OrientedPoints(arrays["points"], arrays["normals"], True)
    return grid, PairTable(points, *(arrays[name].astype(np.int64) for name in ("i", "j", "key")))


def _digest(surface: PartSurface) -> str:
    found = hashlib.blake2b(digest_size=16)
    unseen = () if surface.unseen is None else (surface.unseen,)
    for array in (surface.mesh.vertices, surface.mesh.faces, *unseen):
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()

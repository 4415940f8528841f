"""A grid of planes around the part: the distance of a point to the surface by one lookup, without a search."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.distance import SurfaceTree, keep_tree
from damageest.stages.align.surface.oriented_points import OrientedPoints

Floats32 = NDArray[np.float32]

CELLS = 220_000
"""Number of cells of the grid; on a compact part each is about 1/100 of the diagonal."""


NEAR = 0.06
"""Distance from samples of the skin, in diagonals, within which the grid is exact: more than any band in which points
are compared, and several distances between samples."""

UNKNOWN = -10.0
"""Signed distance, in diagonals, of points below or above skin that only closes an earlier scan: as of a point deep
inside, which may be anything and speaks for no pose and against none."""


@dataclass(frozen=True)
class PartSurface:
    """The part, centred and scaled to a diagonal of 1, for exact closest-point queries. ``unseen`` (F,): triangles that
    only close an earlier scan; None: of a part as designed. ``whole``: the part of diagonal ``size`` that it is made
    of, whose tree is asked, since later stages ask it too; None: there is none but it."""

    mesh: Mesh
    unseen: Flags | None = None
    whole: Mesh | None = None
    size: float = 1.0

    @cached_property
    def known(self) -> Mesh:
        """The triangles that are skin."""
        return self.mesh if self.unseen is None else Mesh(self.mesh.vertices, self.mesh.faces[~self.unseen])

    @cached_property
    def _tree(self) -> SurfaceTree:
        return SurfaceTree(self.mesh) if self.whole is None else keep_tree(self.whole)

    @cached_property
    def normals(self) -> Floats:
        """(F,3) unit normals of the faces."""
        length = np.linalg.norm(self.mesh.cross, axis=1)
        return np.asarray(self.mesh.cross / np.maximum(length, 1e-300)[:, None])

    def closest(self, points: Floats) -> tuple[Floats, Floats, Ints]:
        """Signed distance (N,), positive outside, closest points (N,3) and the faces (N,) that they lie on.

        The sign is that of the nearest face. At a saddle-shaped corner it can be wrong; a robust fit tolerates that.
        """
        distance, face, foot = self._tree.closest(points * self.size)
        distance, foot = distance / self.size, foot / self.size
        outward = np.einsum("ij,ij->i", points - foot, self.normals[face])
        signed = np.copysign(distance, outward)
        if self.unseen is not None:
            signed[self.unseen[face]] = UNKNOWN
        return signed, foot, face


@dataclass(frozen=True)
class PlaneGrid:
    """A grid around the part. Each cell holds the tangent plane at the surface point closest to the cell's centre.

    The distance of a point to that plane is exact on flat faces and right to second order elsewhere, so a coarse grid
    is enough. ``low`` (3,): lowest corner; ``cell``: edge of a cell; ``plane`` (X*Y*Z,4): unit normal and offset;
    ``distance`` (X*Y*Z,): signed, of the cell's centre. All arrays are float32.
    """

    low: Floats32
    cell: float
    shape: tuple[int, int, int]
    plane: Floats32
    distance: Floats32

    @classmethod
    def build(cls, target: PartSurface, samples: OrientedPoints, margin: float = 0.12) -> PlaneGrid:
        """The grid of a part. Cells farther than `NEAR` from all ``samples`` of its skin get the plane of a sample in
        the nearest cell that has one: searches from far away cost most, and there only which side a point lies on
        counts. All such cells that are connected lie on one side."""
        low, high = target.mesh.bounds + np.array([[-margin], [margin]])
        cell = float(np.prod(high - low) / CELLS) ** (1 / 3)
        shape = np.ceil((high - low) / cell).astype(int)
        axes = [low[k] + (np.arange(shape[k]) + 0.5) * cell for k in range(3)]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        nearest = _find_sample_near(((samples.points - low) / cell).astype(np.int64), shape)
        foot, normal = samples.points[nearest], samples.normals[nearest]
        away = np.linalg.norm(centres - foot, axis=1)
        distance = np.copysign(away, np.einsum("ij,ij->i", centres - foot, normal))
        near = away < (NEAR if target.unseen is None else np.inf)  # samples lie on known skin alone
        distance[~near] = _choose_side(distance, ~near.reshape(shape))
        distance[near], foot[near], face = target.closest(centres[near])
        normal[near] = target.normals[face]
        offset = -np.einsum("ij,ij->i", normal, foot)
        plane = np.column_stack([normal, offset]).astype(np.float32)
        size = (int(shape[0]), int(shape[1]), int(shape[2]))
        return cls(low.astype(np.float32), cell, size, plane, distance.astype(np.float32))

    def estimate_distance(self, points: Floats) -> Floats32:
        """(N,) signed distance of the cells that points (N,3) lie in."""
        return self.distance[self.find_cell(points.astype(np.float32))]

    def find_cell(self, points: Floats32) -> Ints:
        """The cell (...) of each of points (...,3); points beyond the grid get the outermost cell, far off the part."""
        at = (points - self.low) * np.float32(1 / self.cell)
        x, y, z = (np.clip(at[..., k], 0, self.shape[k] - 1).astype(np.int64) for k in range(3))
        cell: Ints = (x * self.shape[1] + y) * self.shape[2] + z
        return cell


def _find_sample_near(at: Ints, shape: Ints) -> Ints:
    """For each cell of a grid the number of one of the samples in the nearest cell that has some; ``at`` (N,3): the
    samples' cells."""
    from scipy.ndimage import distance_transform_edt

    sample = np.full(shape, -1, np.int64)
    sample[tuple(at.T)] = np.arange(len(at))
    near = distance_transform_edt(sample < 0, return_distances=False, return_indices=True)
    return np.asarray(sample[tuple(near)].ravel())


def _choose_side(distance: Floats, is_far: Flags) -> Floats:
    """The signed distances of the far cells of a grid, ``is_far`` (X,Y,Z); each connected set of them has the sign that
    most of its ``distance`` (X*Y*Z,) have."""
    from scipy.ndimage import label

    far = is_far.ravel()
    number = label(is_far)[0].ravel()[far]
    votes = np.bincount(number, np.sign(distance[far]))
    return np.copysign(distance[far], votes[number])

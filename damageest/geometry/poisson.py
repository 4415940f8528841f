"""Screened Poisson reconstruction on a regular grid: a field that is zero on oriented points and rises along their
normals.

Kazhdan and Hoppe, "Screened Poisson surface reconstruction" (2013), discretised on a staggered grid: the normals are
distributed to the edges of the grid, and the field has its values at the nodes. The part of the operator with constant
coefficients is inverted by a cosine transform (Neumann conditions at the sides), so that conjugate gradients converge
in a few steps. The zero level becomes a solid with `damageest.geometry.isosurface.extract_region`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats
from damageest.geometry.threads import count_threads, cut_evenly, map_in_threads
from damageest.isolation.memory import require_memory

GridValues = NDArray[np.float32]
"""Values at the nodes of a `Grid`, in its shape."""

BYTES_OF_NODE, BYTES_OF_POINT = 60, 300
"""Memory of a solution, measured on grids of 0.4 to 24 million nodes with up to 400,000 points."""

CACHED, CACHED_VALUES = 4000, 200_000
"""Points, and values of a field, that are taken at a time, so that what is computed of them stays in the cache."""


@dataclass(frozen=True)
class Grid:
    """Nodes at ``origin + cell * (i, j, k)``, as many along x, y and z as ``shape`` tells.

    ``origin`` (3,) and ``cell`` are lengths in one unit, in the frame of the points used with the grid.
    """

    origin: Floats
    cell: float
    shape: tuple[int, int, int]

    @property
    def size(self) -> int:
        """The number of nodes."""
        return int(np.prod(self.shape))

    def coarsen(self) -> Grid:
        """The grid of half the resolution, each node in the middle of eight; the shape has to be even."""
        nx, ny, nz = (n // 2 for n in self.shape)
        return Grid(self.origin + self.cell / 2, 2 * self.cell, (nx, ny, nz))

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Whether each of the points (N,3) lies within the grid (N,)."""
        at = (points - self.origin) / self.cell
        return np.asarray(((at >= 0) & (at <= np.array(self.shape) - 1.001)).all(axis=1))

    def find_corners(self, points: Floats, shift: Floats | None = None) -> tuple[NDArray[np.int64], Floats]:
        """The eight nodes around each of the points (N,3), for trilinear interpolation.

        Gives their indices in the flat field (N,8) and their weights (N,8), which add up to 1. ``shift`` (3,) moves the
        nodes by that many cells. A point outside the grid is taken at its side.
        """
        nodes, weights = np.empty((len(points), 8), np.int64), np.empty((len(points), 8))
        steps = [(i * self.shape[1] + j) * self.shape[2] + k for i in range(2) for j in range(2) for k in range(2)]
        for own in cut_evenly(len(points), CACHED):
            at = (points[own] - self.origin) / self.cell - (0 if shift is None else shift)
            at = np.clip(at, 0, np.array(self.shape) - 1.001)
            low = np.floor(at)
            far = (at - low).T.copy()
            (i, j, k), near = low.astype(np.int64).T, 1 - far
            nodes[own] = ((i * self.shape[1] + j) * self.shape[2] + k)[:, None] + np.array(steps)
            sides = [x * y for x in (near[0], far[0]) for y in (near[1], far[1])]
            weights[own] = np.stack([side * z for side in sides for z in (near[2], far[2])], axis=1)
        return nodes, weights


def make_grid(low: Floats, high: Floats, cell: float) -> Grid:
    """A grid of spacing ``cell`` over the box from ``low`` (3,) to ``high`` (3,).

    It is somewhat larger than the box, so that its shape is efficient for the cosine transform and can be halved twice.
    """
    from scipy.fft import next_fast_len

    counts = [max(4 * int(next_fast_len(int(np.ceil(n / 4)) + 1, real=True)), 16) for n in (high - low) / cell]
    slack = (np.array(counts) - 1) * cell - (high - low)
    return Grid(low - slack / 2, cell, (counts[0], counts[1], counts[2]))


def solve_poisson(
    grid: Grid, points: Floats, normals: Floats, areas: Floats, screening: float, start: GridValues | None = None,
    accuracy: float = 2e-3, most: int = 30,
) -> GridValues:  # fmt: skip
    """The field (shape of the grid) that is 0 on the points and rises along their normals.

    Across the surface it rises by about 1, within a few cells.

    Args:
        grid: nodes of the field.
        points, normals: (N,3) points within the grid, and unit normals toward the positive side.
        areas: (N,) the area of surface that each point stands for, in the square of the points' unit.
        screening: weight of the condition that the field is 0 on the points; 0 leaves it out.
        start: first guess, such as the refined solution of a coarser grid; it becomes the result.
        accuracy: norm of the residual, relative to the right side, at which the solver stops.
        most: largest number of conjugate-gradient steps.
    """
    from scipy.sparse import csr_array

    share = areas / grid.cell**2
    right = _divergence(grid, points, normals * share[:, None])
    nodes, weights = grid.find_corners(points)
    rows = np.arange(0, 8 * len(points) + 1, 8)
    look = csr_array((weights.ravel().astype(np.float32), nodes.ravel(), rows), shape=(len(points), grid.size))
    pull = (screening * share).astype(np.float32)
    back = csr_array(look.T)
    shift = float(pull.sum()) / grid.size
    eigenvalues = _eigenvalues(grid) + shift
    if not shift:  # nothing fixes the mean of the field: it is 0
        eigenvalues[0, 0, 0] = np.inf

    def apply(x: GridValues) -> GridValues:
        out = _laplacian(x)
        out += (back @ (pull * (look @ x.ravel()))).reshape(grid.shape)
        return out

    # Arrays are changed in place where that is possible: on large grids they are most of a run's memory.
    x: GridValues = _precondition(right, eigenvalues) if start is None else start
    goal = accuracy * float(np.sqrt(np.vdot(right, right)))
    r = right
    r -= apply(x)
    p = _precondition(r, eigenvalues)
    rho = float(np.vdot(r, p))
    for _ in range(most):
        if float(np.sqrt(np.vdot(r, r))) <= goal or rho <= 0:
            break
        q = apply(p)
        step = np.float32(rho / float(np.vdot(p, q)))
        x += step * p
        q *= step
        r -= q
        del q
        z = _precondition(r, eigenvalues)
        rho, before = float(np.vdot(r, z)), rho
        p *= np.float32(rho / before)
        p += z
        del z
    return x


def solve_coarse_to_fine(grid: Grid, points: Floats, normals: Floats, areas: Floats, screening: float) -> GridValues:
    """As `solve_poisson`, started from the solution on a grid of half the resolution.

    It then needs fewer steps on the fine grid. Grids of fewer than 300,000 nodes are solved at once. The shape of a
    larger one has to be even. Raises StageError where the memory that is free does not suffice.
    """
    needed = BYTES_OF_NODE * grid.size + BYTES_OF_POINT * len(points)
    require_memory(needed, f"a grid of {grid.size:,} nodes, {grid.cell:.3g} apart", "a larger tolerance")
    if grid.size < 300_000:
        return solve_poisson(grid, points, normals, areas, screening)
    half = grid.coarsen()
    inside = half.contains(points)
    start = solve_coarse_to_fine(half, points[inside], normals[inside], areas[inside], screening)
    # The coarse field has the same step across the surface, over twice the length, so it needs no scaling.
    return solve_poisson(grid, points, normals, areas, screening, refine_field(start), 1e-2, 8)


def refine_field(coarse: GridValues) -> GridValues:
    """A field on ``grid.coarsen()``, interpolated linearly to the nodes of ``grid``: twice as many along each axis."""
    out: GridValues = coarse
    for axis in range(3):
        x: GridValues = np.moveaxis(out, axis, 0)
        low, high = np.concatenate([x[:1], x[:-1]]), np.concatenate([x[1:], x[-1:]])
        pair = np.stack([0.75 * x + 0.25 * low, 0.75 * x + 0.25 * high], axis=1)
        out = np.moveaxis(pair.reshape(-1, *x.shape[1:]).astype(np.float32), 0, axis)
    return np.ascontiguousarray(out, dtype=np.float32)


def _divergence(grid: Grid, points: Floats, vectors: Floats) -> GridValues:
    """The adjoint of the grid's gradient, applied to the vectors (N,3) distributed to the middles of the edges."""
    total = np.zeros(grid.shape, np.float32)
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = 0.5
        nodes, weights = grid.find_corners(points, shift)
        flow = np.bincount(nodes.ravel(), (weights * vectors[:, axis, None]).ravel(), grid.size)
        along: GridValues = np.moveaxis(flow.reshape(grid.shape).astype(np.float32), axis, 0)
        out = np.moveaxis(total, axis, 0)
        out[1:] += along[:-1]
        out[:-1] -= along[:-1]
    return total


def _laplacian(x: GridValues) -> GridValues:
    """Minus the Laplace operator in units of the cell, with Neumann conditions at the sides."""
    out = np.empty_like(x)
    layers = max(1, CACHED_VALUES // max(x[0].size, 1))

    def fill(own: slice) -> None:
        """The layers ``own`` of the result: few enough to stay in the processor's cache."""
        first, last = max(own.start - 1, 0), min(own.stop, len(x) - 1) + 1
        some, into = x[first:last], np.zeros_like(x[first:last])
        for axis in range(3):
            a, o = np.moveaxis(some, axis, 0), np.moveaxis(into, axis, 0)
            step = a[1:] - a[:-1]
            o[1:] += step
            o[:-1] -= step
        stop = min(own.stop, len(x))
        out[own.start : stop] = into[own.start - first : stop - first]

    map_in_threads(fill, cut_evenly(len(x), layers))
    return out


def _eigenvalues(grid: Grid) -> GridValues:
    """The eigenvalue of `_laplacian` for each wave of the cosine transform."""
    waves = [(2 - 2 * np.cos(np.pi * np.arange(n) / n)).astype(np.float32) for n in grid.shape]
    return np.asarray(waves[0][:, None, None] + waves[1][None, :, None] + waves[2][None, None, :], dtype=np.float32)


def _precondition(right: GridValues, eigenvalues: GridValues) -> GridValues:
    """The solution with the constant-coefficient part of the operator alone."""
    from scipy.fft import dctn, idctn

    waves = dctn(right, workers=count_threads())
    waves /= eigenvalues
    return np.asarray(idctn(waves, workers=count_threads(), overwrite_x=True), dtype=np.float32)

"""A screened Poisson solve on a regular grid: one indicator-like field through oriented points.

Kazhdan and Hoppe, "Screened Poisson surface reconstruction" (2013), discretised on a staggered grid: the normals are
splatted to the grid's edges, the field lives at its nodes, and the constant-coefficient part of the operator is
inverted by a cosine transform (free, i.e. Neumann, sides), which makes conjugate gradients converge in a few steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats

GridValues = NDArray[np.float32]


@dataclass(frozen=True)
class Grid:
    """Nodes at ``origin + cell * (i, j, k)``, ``shape`` of them along x, y, z."""

    origin: Floats
    cell: float
    shape: tuple[int, int, int]

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))

    def coarsen(self) -> Grid:
        """Half the resolution, each node in the middle of eight; the shape has to be even."""
        nx, ny, nz = (n // 2 for n in self.shape)
        return Grid(self.origin + self.cell / 2, 2 * self.cell, (nx, ny, nz))

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Which points (N,3) lie within the grid."""
        at = (points - self.origin) / self.cell
        return np.asarray(((at >= 0) & (at <= np.array(self.shape) - 1.001)).all(axis=1))

    def find_corners(self, points: Floats, shift: Floats | None = None) -> tuple[NDArray[np.int64], Floats]:
        """Flat node indices (N,8) round each point and trilinear weights (N,8); ``shift`` moves the nodes, in cells."""
        at = (points - self.origin) / self.cell - (0 if shift is None else shift)
        at = np.clip(at, 0, np.array(self.shape) - 1.001)
        low = np.floor(at).astype(np.int64)
        part = at - low
        nodes = np.empty((len(points), 8), np.int64)
        weights = np.empty((len(points), 8))
        for corner in range(8):
            bit = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1])
            i, j, k = (low + bit).T
            nodes[:, corner] = (i * self.shape[1] + j) * self.shape[2] + k
            weights[:, corner] = np.where(bit, part, 1 - part).prod(axis=1)
        return nodes, weights


def make_grid(low: Floats, high: Floats, cell: float) -> Grid:
    """The grid over a box; its shape suits the cosine transform and two halvings."""
    from scipy.fft import next_fast_len

    counts = [max(4 * int(next_fast_len(int(np.ceil(n / 4)) + 1, real=True)), 16) for n in (high - low) / cell]
    slack = (np.array(counts) - 1) * cell - (high - low)
    return Grid(low - slack / 2, cell, (counts[0], counts[1], counts[2]))


def solve_poisson(
    grid: Grid, points: Floats, normals: Floats, areas: Floats, screening: float, start: GridValues | None = None,
    accuracy: float = 2e-3, most: int = 30,
) -> GridValues:  # fmt: skip
    """The field (shape of the grid), 0 on the points and rising along their normals.

    Args:
        points, normals: (N,3), in the grid.
        areas: (N,), what area of the surface each point stands for.
        screening: how strongly the points pull the field to 0.
        start: a first guess, such as the refined solution of a coarser grid.
        accuracy: of the residual, relative to the right side.
        most: steps of conjugate gradients.
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
    symbol = _symbol(grid) + shift

    def apply(x: GridValues) -> GridValues:
        drawn: GridValues = (back @ (pull * (look @ x.ravel()))).reshape(grid.shape)
        return _laplacian(x) + drawn

    x: GridValues = _precondition(right, symbol) if start is None else start.copy()
    r = right - apply(x)
    goal = accuracy * float(np.sqrt(np.vdot(right, right)))
    z = _precondition(r, symbol)
    p, rho = z, float(np.vdot(r, z))
    for _ in range(most):
        if float(np.sqrt(np.vdot(r, r))) <= goal or rho <= 0:
            break
        q = apply(p)
        step = np.float32(rho / float(np.vdot(p, q)))
        x += step * p
        r -= step * q
        z = _precondition(r, symbol)
        rho, before = float(np.vdot(r, z)), rho
        p = z + np.float32(rho / before) * p
    return x


def solve_coarse_to_fine(grid: Grid, points: Floats, normals: Floats, areas: Floats, screening: float) -> GridValues:
    """As `solve`, from the solution at half the resolution: a few fine steps do what took many."""
    if grid.size < 300_000:
        return solve_poisson(grid, points, normals, areas, screening)
    half = grid.coarsen()
    inside = half.contains(points)
    start = solve_coarse_to_fine(half, points[inside], normals[inside], areas[inside], screening)
    # The coarse field rises over twice the length: the same step across the surface, so no scaling is due.
    return solve_poisson(grid, points, normals, areas, screening, refine_field(start), 1e-2, 8)


def refine_field(coarse: GridValues) -> GridValues:
    """The field of ``Grid.coarser()`` carried to the nodes of the finer grid, linearly."""
    out: GridValues = coarse
    for axis in range(3):
        x: GridValues = np.moveaxis(out, axis, 0)
        low, high = np.concatenate([x[:1], x[:-1]]), np.concatenate([x[1:], x[-1:]])
        pair = np.stack([0.75 * x + 0.25 * low, 0.75 * x + 0.25 * high], axis=1)
        out = np.moveaxis(pair.reshape(-1, *x.shape[1:]).astype(np.float32), 0, axis)
    return np.ascontiguousarray(out, dtype=np.float32)


def _divergence(grid: Grid, points: Floats, vectors: Floats) -> GridValues:
    """Adjoint of the grid's gradient, applied to vectors splatted to the edges' middles."""
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
    out = np.zeros_like(x)
    for axis in range(3):
        a, o = np.moveaxis(x, axis, 0), np.moveaxis(out, axis, 0)
        step = a[1:] - a[:-1]
        o[1:] += step
        o[:-1] -= step
    return out


def _symbol(grid: Grid) -> GridValues:
    waves = [(2 - 2 * np.cos(np.pi * np.arange(n) / n)).astype(np.float32) for n in grid.shape]
    return np.asarray(waves[0][:, None, None] + waves[1][None, :, None] + waves[2][None, None, :], dtype=np.float32)


def _precondition(right: GridValues, symbol: GridValues) -> GridValues:
    from scipy.fft import dctn, idctn

    return np.asarray(idctn(dctn(right, workers=2) / symbol, workers=2, overwrite_x=True), dtype=np.float32)

"""Marks voxels in beads, in a loop that the Numba library compiles.

It is imported where it is used only: Numba takes a third of a second to load.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest_paths.clearance.compiling import compile_loops

TINY = 1e-9
"""Edges of a voxel by which its centre may lie outside of a bead."""


@compile_loops
def mark_voxels(
    done: Flags, start: Floats, stop: Floats, normal: Floats, sizes: Floats, owner: Ints, share: Floats, span: int
) -> None:
    """Marks in ``done`` (X,Y,Z) the voxels whose centre lies in a bead, all lengths in edges of a voxel.

    ``start``, ``stop``, ``normal`` (N,3) and ``sizes`` (N,2), width and height, of pieces of beads: see `Beads`. Looked
    at are the voxels up to ``span`` along each axis from the middle of the bead below some places: those at the shares
    ``share`` (K,) of the pieces with the numbers ``owner`` (K,).
    """
    for k in range(len(owner)):
        n = owner[k]
        nx, ny, nz = normal[n, 0], normal[n, 1], normal[n, 2]
        ax, ay, az = stop[n, 0] - start[n, 0], stop[n, 1] - start[n, 1], stop[n, 2] - start[n, 2]
        long = np.sqrt(ax * ax + ay * ay + az * az)
        scale = 1.0 / max(long, 1e-300)
        lx, ly, lz = ax * scale, ay * scale, az * scale
        rise = lx * nx + ly * ny + lz * nz
        half, high = sizes[n, 0] / 2, sizes[n, 1]
        most = half * half + TINY
        i = int(np.floor(start[n, 0] + share[k] * ax - high / 2 * nx))
        j = int(np.floor(start[n, 1] + share[k] * ay - high / 2 * ny))
        h = int(np.floor(start[n, 2] + share[k] * az - high / 2 * nz))
        for x in range(max(i - span, 0), min(i + span + 1, done.shape[0])):
            for y in range(max(j - span, 0), min(j + span + 1, done.shape[1])):
                for z in range(max(h - span, 0), min(h + span + 1, done.shape[2])):
                    if done[x, y, z]:
                        continue
                    dx, dy, dz = x + 0.5 - start[n, 0], y + 0.5 - start[n, 1], z + 0.5 - start[n, 2]
                    along = dx * lx + dy * ly + dz * lz
                    beside = min(max(along, 0.0), long)
                    up = dx * nx + dy * ny + dz * nz - beside * rise
                    if up > TINY or up < -high - TINY:
                        continue
                    across = dx * dx + dy * dy + dz * dz - up * up - beside * (2 * along - beside)
                    if across <= most:
                        done[x, y, z] = True

"""Simulates the beads of a path on voxels: what they fill, what they leave, and what lies outside the deposit.

A bead is a block: as wide as the bead, as high as the layer, swept along the pass, with round ends. How metal flows,
heats up, warps or shrinks is not simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import BeadFill, Flags, Floats, Mesh
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.rays import prepare_rays
from damageest.geometry.voxels import measure_bounds
from damageest_paths.process.frames import Frame

SHARE = 4
"""Voxels along the shorter side of a bead's section."""
MOST_VOXELS = 60_000_000
OVERHANGS = 3.0
"""Air below a bead, in heights of it, from which it hangs over beside the floor."""
MOST_RAYS = 10_000
"""Pieces of beads below which the air is measured, or up to twice as many."""


@dataclass(frozen=True, eq=False)
class Beads:
    """Pieces of beads: from ``start`` (N,3) to ``stop`` (N,3) on the top of the bead, ``normal`` (N,3) of the layer,
    ``width`` and ``height`` (N,)."""

    start: Floats
    stop: Floats
    normal: Floats
    width: Floats
    height: Floats


def simulate_beads(
    beads: Beads, deposit: Mesh, missing: Mesh | None, metal: Mesh | None, frame: Frame, edge: float
) -> BeadFill:
    """Compares the union of beads with the deposit, on voxels of an ``edge`` along the axes of a frame.

    ``missing``: what of the deposit is known to be out of reach. The edge is larger where the voxels would be too many.
    """
    from scipy import ndimage

    local = Mesh(frame.to_local(deposit.vertices), deposit.faces)
    low, size, edge = _choose_grid(local, beads, frame, edge)
    wanted = _fill_solid(local, low, size, edge)
    reachable = wanted.copy()
    if missing is not None:
        reachable &= ~_fill_solid(Mesh(frame.to_local(missing.vertices), missing.faces), low, size, edge)
    done = stamp_beads(beads, frame, low, size, edge)
    gaps = reachable & ~done
    spilled = done & ~wanted
    sunk = np.zeros_like(done)
    if metal is not None:
        sunk = spilled & _fill_solid(Mesh(frame.to_local(metal.vertices), metal.faces), low, size, edge)
        spilled &= ~sunk
    cell = edge**3
    pieces, _ = ndimage.label(gaps)
    largest = int(np.bincount(pieces.ravel())[1:].max(initial=0))
    depth = edge * _measure_depth(gaps, ndimage.find_objects(pieces))
    # the border of the deposit goes through voxels, so that its outermost ones may be beads though just outside
    rim = spilled & ~_widen(wanted)
    places = low + (np.argwhere(rim) + 0.5) * edge
    far = float(distance_to_mesh(places, local).max()) if len(places) else 0.0
    return BeadFill(
        edge,
        1.0 - gaps.sum() / max(int(reachable.sum()), 1),
        float(gaps.sum() * cell),
        max(2 * depth - edge, 0.0),
        largest * cell,
        float(spilled.sum() * cell),
        far,
        float(sunk.sum() * cell),
        float((done & wanted).sum() / max(int(wanted.sum()), 1)),
        *(_measure_air(beads, metal, frame.to_local, done, low, edge) if metal is not None else (0.0, 0.0)),
    )


def _measure_air(
    beads: Beads, metal: Mesh, to_local: Callable[[Floats], Floats], done: Flags, low: Floats, edge: float
) -> tuple[float, float]:
    """The height of the air, in the median and in 95 % of the length, between metal and the beads that lie on it, not
    on a bead: below those no voxel is in a bead. ``done``: the voxels in beads."""
    middle, length = (beads.start + beads.stop) / 2, np.linalg.norm(beads.stop - beads.start, axis=1)
    bottom = beads.height + 1.5 * edge  # the voxel below the bead, whose middle lies outside it
    below = to_local(middle - bottom[:, None] * beads.normal)
    i, j, k = np.clip(np.floor((below - low) / edge).astype(np.int64), 0, np.array(done.shape) - 1).T
    some = np.flatnonzero(~done[i, j, k])
    some = some[:: max(1, len(some) // MOST_RAYS)]
    depth = prepare_rays(metal).find_first(middle[some], -beads.normal[some])[0]
    air = np.maximum(depth - beads.height[some], 0.0)
    on_metal = air < OVERHANGS * beads.height[some]  # what is farther from it hangs over beside the floor
    air, length = air[on_metal], length[some][on_metal]
    if not length.sum() > 0:
        return 0.0, 0.0
    half, most = np.quantile(air, (0.5, 0.95), weights=length, method="inverted_cdf").tolist()
    return half, most


def _measure_depth(gaps: Flags, boxes: Sequence[tuple[slice, ...]]) -> float:
    """The largest distance, in voxels, of a voxel in a gap from one outside, found box by box: mostly the gaps are a
    small part of the grid. Where gaps touch at edges it may be a little too large."""
    from scipy import ndimage

    found = 0.0
    for box in boxes:
        if (min(own.stop - own.start for own in box) + 1) / 2 > found:
            wider = tuple(slice(max(own.start - 1, 0), own.stop + 1) for own in box)
            found = max(found, float(ndimage.distance_transform_edt(gaps[wider]).max()))
    return found


def _widen(solid: Flags) -> Flags:
    """The voxels of a solid and the 26 round each of them."""
    for axis in range(3):
        along = np.moveaxis(solid, axis, 0)
        wider = along.copy()
        wider[1:] |= along[:-1]
        wider[:-1] |= along[1:]
        solid = np.moveaxis(wider, 0, axis)
    return solid


def _choose_grid(local: Mesh, beads: Beads, frame: Frame, edge: float) -> tuple[Floats, tuple[int, int, int], float]:
    """Lowest corner (3,), number of voxels along each axis, and their edge."""
    corners = [local.bounds]
    if len(beads.start):
        ends = frame.to_local(np.concatenate([beads.start, beads.stop]))
        corners.append(measure_bounds(ends))
    reach = float(max(beads.width.max(initial=0.0), beads.height.max(initial=0.0)))
    low = np.min([each[0] for each in corners], axis=0) - reach - 2 * edge
    high = np.max([each[1] for each in corners], axis=0) + reach + 2 * edge
    total = float(np.prod((high - low) / edge))
    edge *= max(1.0, (total / MOST_VOXELS) ** (1 / 3))
    nx, ny, nz = (int(np.ceil(extent / edge)) for extent in high - low)
    return low, (nx, ny, nz), edge


def _fill_solid(mesh: Mesh, low: Floats, size: tuple[int, int, int], edge: float) -> Flags:
    """Whether the centre of each voxel lies in a closed mesh."""
    import pyvista as pv
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkImagingStencil import vtkImageStencilToImage, vtkPolyDataToImageStencil

    surface = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    stencil = vtkPolyDataToImageStencil()
    stencil.SetInputData(surface)
    stencil.SetOutputOrigin(*(low + edge / 2))
    stencil.SetOutputSpacing(edge, edge, edge)
    stencil.SetOutputWholeExtent(0, size[0] - 1, 0, size[1] - 1, 0, size[2] - 1)
    stencil.SetTolerance(0.0)
    image = vtkImageStencilToImage()
    image.SetInputConnection(stencil.GetOutputPort())
    image.SetOutputScalarTypeToUnsignedChar()
    image.SetInsideValue(1)
    image.SetOutsideValue(0)
    image.Update()
    values = vtk_to_numpy(image.GetOutput().GetPointData().GetScalars())
    return np.asarray(values.reshape(size[::-1]).transpose(2, 1, 0).astype(bool))


def stamp_beads(beads: Beads, frame: Frame, low: Floats, size: tuple[int, int, int], edge: float) -> Flags:
    """Whether the centre of each voxel lies in a bead."""
    from damageest_paths.clearance.compiling import run_loops
    from damageest_paths.stamping import mark_voxels

    done = np.zeros(size, bool)
    if not len(beads.start):
        return done
    start, stop = frame.to_local(beads.start), frame.to_local(beads.stop)
    normal = beads.normal @ frame.turn.T
    length = np.linalg.norm(stop - start, axis=1)
    counts = np.maximum(np.ceil(length / (beads.width / 2)).astype(int), 1)
    owner = np.repeat(np.arange(len(start)), counts)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts])
    reach = np.hypot(beads.width.max() / 2, beads.height.max() / 2)
    half = reach + float((length / counts).max()) / 2 + np.sqrt(3) * edge
    span = int(np.ceil(half / edge))
    sizes = np.stack([beads.width, beads.height], axis=1) / edge
    run_loops(mark_voxels, done, (start - low) / edge, (stop - low) / edge, normal, sizes, owner, share, span)
    return done

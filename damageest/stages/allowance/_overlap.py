"""Finds the intact skin around the rim of a damage that the stock overlaps."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Part
from damageest.geometry.cutting import cut_triangles
from damageest.geometry.distance import closest_on_mesh, distance_to_edges
from damageest.geometry.edges import list_edges
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.stages.allowance._selectors import StockPlan
from damageest.stages.allowance._skin import ON_PART, SkinFaces, label_skin


def grow_over_rim(
    skin: SkinFaces, part: Part, plan: StockPlan, overlap: float, tolerance: float, origin: Floats
) -> SkinFaces | None:
    """The part's skin within ``overlap`` of the rim, on both sides of it, where it is connected to the rim.

    Its stock is that of the plan. None where no skin is overlapped.
    """
    from manifold3d import Manifold

    rim = _find_rim(skin)
    if not overlap or not len(rim):
        return None
    ends = skin.vertices[rim]
    margin = overlap + tolerance
    low, high = ends.min(axis=(0, 1)) - margin, ends.max(axis=(0, 1)) + margin
    near = to_manifold(part, origin) ^ Manifold.cube(tuple(high - low)).translate(tuple(low))
    # so fine that the distance, linear on each triangle, is right within a fraction of the tolerance
    near = near.refine_to_length(max(overlap / 2, tolerance / 2))
    vertices, faces = to_arrays(near)
    value = overlap - distance_to_edges(vertices, skin.vertices, rim)
    close = (value[faces] > 0).any(axis=1)
    vertices, faces, _, inside = cut_triangles(vertices, faces[close], value)
    faces = faces[inside]
    if not len(faces):
        return None
    faces = _keep_connected(vertices, faces, ends.mean(axis=1), part)
    band = label_skin(vertices, faces, part, plan, origin)
    return band if (band.height > 0).any() else None


def _find_rim(skin: SkinFaces) -> Ints:
    """(E,2) edges between skin with stock and intact skin: edges of one face of the damage's skin only."""
    border = skin.find_border_edges()
    if not len(border):
        return border
    edges = list_edges(skin.faces).reshape(-1, 3, 2)
    tall = edges[skin.height > 0].reshape(-1, 2)
    size = len(skin.vertices)
    return np.asarray(border[np.isin(border @ [size, 1], tall @ [size, 1])])


def _keep_connected(vertices: Floats, faces: Ints, places: Floats, part: Part) -> Ints:
    """The faces that are connected, by their corners, to a face on which one of ``places`` (M,3) lies."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = len(vertices)
    rows, columns = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    _, label = connected_components(
        coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size)), directed=False
    )
    distance, face, _ = closest_on_mesh(places, Mesh(vertices, faces))
    seeds = np.unique(label[faces[face[distance <= 10 * ON_PART * part.diagonal], 0]])
    return np.asarray(faces[np.isin(label[faces[:, 0]], seeds)])

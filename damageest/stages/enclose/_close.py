"""The closed mesh of carried-on damage surface, strips and cut-off background, on the side that is lost."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Surface
from damageest.errors import StageError
from damageest.geometry.distance import is_inside, winding_number
from damageest.stages.enclose import NotSeparatedError
from damageest.stages.enclose._sew import Cycle, Wide, build_strip, cut_off, fill_loops

BESIDE = 32
"""Sound points about each rim node that are asked on which side of the damage surface they lie."""
MARGIN = 0.1
"""Share of the sound points that the two sides must differ by."""
WRONG = 0.03
"""Share of the damage surface that may have the enclosure's inside on the wrong side: a little, where it is creased."""
THROUGH = 0.1
"""Share of the damage surface's area that the strips' area inside the part may have: where the scan has a gap at the
rim, the straight way out is as good as any."""
INSTEAD = "method: implicit"


def close_enclosure(
    surface: Surface, wide: Wide, background: Mesh, cycles: list[Cycle], intact: Floats, part: Part, tolerance: float
) -> Mesh:
    """Sews ``wide``, which carries ``surface`` on, to what the ``cycles``, one for each of its rims, cut off the
    background (paper 3.1 steps 10 and 11).

    Raises NotSeparatedError where they cut nothing off, StageError where the sound points do not tell the sides apart,
    or a strip runs through the part.
    """
    from scipy.spatial import cKDTree

    start = len(wide.vertices)
    vertices = np.concatenate([wide.vertices, background.vertices])
    strips = [build_strip(loop, other, start) for loop, other in zip(wide.loops, cycles, strict=True)]
    if (share := _measure_through(Mesh(vertices, np.concatenate(strips)), part, tolerance) / surface.area) > THROUGH:
        raise StageError(
            f"the way from the rim to the background leads through the part ({share:.0%} of the damage surface's area)",
            "background: minkowski, which keeps close to the part, or method: implicit",
        )
    body = np.concatenate([fill_loops(wide), *strips])
    found = []
    for turned in (True, False):
        side = cut_off(background.faces, [other.path for other in cycles], against=turned)
        if side is not None:
            found.append(Mesh(vertices, np.concatenate([body[:, ::-1] if turned else body, side + start])))
    if not found:
        raise NotSeparatedError("the paths on the background do not split it in two", INSTEAD)
    low, high = background.bounds
    near = intact[((intact > low) & (intact < high)).all(axis=1)]
    # A few thousand tell; of a background that is made round the site alone, those that lie in it. Points beside the
    # rim, no deeper than the tolerance, belong to either side.
    few = near[:: max(1, len(near) // 4000)]
    few = few[is_inside(few, background)]
    few = few[cKDTree(surface.vertices).query(few, workers=2)[0] > 3 * tolerance] if len(few) else few
    kept = [float(is_inside(few, mesh).mean()) if len(few) else 0.0 for mesh in found]
    best = int(np.argmin(kept))
    if kept[best] > 0.02:
        raise NotSeparatedError(
            f"either side of the damage surface holds sound points ({kept[best]:.0%} at best)", INSTEAD
        )
    if len(found) > 1 and max(kept) - kept[best] < MARGIN:
        raise StageError(
            f"the sound points do not tell which side is lost: {kept[0]:.0%} and {kept[1]:.0%} of them inside", INSTEAD
        )
    if (wrong := _measure_wrong_side(found[best], len(surface.faces), tolerance)) > WRONG:
        raise StageError(f"the strip to the background runs through {wrong:.0%} of the damage surface", INSTEAD)
    return found[best]


def orient_by_intact(surface: Surface, rims: Rims, intact: Floats) -> tuple[Surface, Rims]:
    """The surface, each piece of it turned so that its normals point away from the sound points beside its rim; and the
    rims, turned with it.

    A piece that leaves the skin too flatly for its sound neighbours to tell is left as it is.
    """
    from scipy.spatial import cKDTree

    if not len(intact) or not rims.loops:
        return surface, rims
    label = _label_pieces(surface)
    nodes = np.concatenate(rims.loops)
    count = min(BESIDE, len(intact))
    beside = np.asarray(cKDTree(intact).query(surface.vertices[nodes], count, workers=2)[1]).reshape(len(nodes), count)
    # The nearest lie above the rim, which ends a tolerance below the skin; the farther ones lie to the side.
    way = intact[beside[:, count // 2 :]] - surface.vertices[nodes][:, None]
    lean = np.einsum("ijk,ik->ij", way, surface.vertex_normals[nodes]) / np.maximum(np.linalg.norm(way, axis=2), 1e-300)
    piece_of = np.zeros(len(surface.vertices), dtype=np.int64)
    piece_of[surface.faces] = label[:, None]
    size = label.max() + 1
    votes = np.bincount(piece_of[nodes], lean.mean(axis=1), size)
    wrong = votes > 0.1 * np.bincount(piece_of[nodes], np.abs(lean).mean(axis=1), size)
    faces = np.where(wrong[label][:, None], surface.faces[:, ::-1], surface.faces)
    loops = tuple(loop[::-1] if wrong[piece_of[loop[0]]] else loop for loop in rims.loops)
    return Surface(surface.vertices, faces), Rims(loops)


def _label_pieces(surface: Surface) -> Ints:
    """(F,) which piece each face belongs to."""
    import trimesh

    pairs = trimesh.graph.face_adjacency(surface.faces)
    return np.asarray(trimesh.graph.connected_component_labels(pairs, node_count=len(surface.faces)), dtype=np.int64)


def _measure_through(strips: Mesh, part: Part, tolerance: float) -> float:
    """Area of the strips that lies inside the part, farther from its skin than the rim has to be."""
    from damageest.geometry.distance import signed_distance

    area = np.linalg.norm(strips.cross, axis=1) / 2
    # A long triangle is looked at along its length: at the middle of it, and between the middle and the corners.
    share = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4], [3, 3, 0], [3, 0, 3], [0, 3, 3]], dtype=np.float64)
    share /= share.sum(axis=1)[:, None]
    points = np.einsum("sc,fck->fsk", share, strips.triangles)
    depth = -signed_distance(points.reshape(-1, 3), part)[0].reshape(len(area), -1)
    return float((area * (depth > 2 * tolerance).mean(axis=1)).sum())


def _measure_wrong_side(mesh: Mesh, count: int, tolerance: float) -> float:
    """Share of the first ``count`` faces (a thousand of them) that do not have the inside behind and the outside
    before.

    A strip that crosses the surface, or a background cut that folds over, shows there and nowhere else.
    """
    chosen = np.unique(np.linspace(0, count - 1, min(count, 1000)).astype(np.int64))
    middle = mesh.triangles[chosen].mean(axis=1)
    step = mesh.cross[chosen]
    step = step * (0.5 * tolerance / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
    behind, before = (winding_number(middle + way * step, mesh) for way in (-1, 1))
    right = (np.abs(behind - 1) < 0.5) & (np.abs(before) < 0.5)
    return float(1 - right.mean())

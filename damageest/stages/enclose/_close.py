"""The closed mesh of extended damage surface, strips and cut-off background, on the side of the lost metal."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Rims, Surface
from damageest.errors import StageError
from damageest.geometry.body_repair import label_bodies
from damageest.geometry.distance import is_inside, winding_number
from damageest.geometry.threads import count_threads
from damageest.stages.enclose import NotSeparatedError
from damageest.stages.enclose._sew import ClosedPath, ExtendedSurface, build_strip, cut_off, fill_loops

BESIDE = 32
"""Intact points near each rim node that show on which side of the damage surface the metal is."""
LEAST_DIFFERENCE = 0.1
"""By how much the shares of intact points on the two sides must differ."""
MOST_WRONG = 0.03
"""Share of the damage surface that may have the inside of the enclosure on its wrong side, as at sharp creases."""
MOST_THROUGH = 0.1
"""Area of the strips inside the part, at most, as a share of the damage surface. Where the scan has a gap at the rim,
the strip has to cross some metal."""


def close_enclosure(
    surface: Surface,
    wide: ExtendedSurface,
    background: Mesh,
    paths: list[ClosedPath],
    intact: Floats,
    part: Part,
    tolerance: float,
) -> Mesh:
    """The closed mesh of ``wide``, which is ``surface`` extended, and the piece of background that the ``paths`` cut
    off, one path for each rim (paper 3.1 steps 10 and 11).

    Raises NotSeparatedError where the paths do not split the background, StageError where the intact points do not show
    which side is lost, or where a strip runs through the part.
    """
    from scipy.spatial import cKDTree

    start = len(wide.vertices)
    vertices = np.concatenate([wide.vertices, background.vertices])
    strips = [build_strip(loop, path, start) for loop, path in zip(wide.loops, paths, strict=True)]
    if (
        share := measure_through(Mesh(vertices, np.concatenate(strips)), part, tolerance) / surface.area
    ) > MOST_THROUGH:
        raise StageError(
            f"the strip from the rim to the background runs through the part (area: {share:.0%} of the damage surface)",
            "background: minkowski, which stays close to the part",
            method="implicit",
        )
    body = np.concatenate([fill_loops(wide), *strips])
    candidates = []
    for turned in (True, False):
        side = cut_off(background.faces, [path.vertices for path in paths], against=turned)
        if side is not None:
            candidates.append(Mesh(vertices, np.concatenate([body[:, ::-1] if turned else body, side + start])))
    if not candidates:
        raise NotSeparatedError("the paths on the background do not split it in two", method="implicit")
    low, high = background.bounds
    near = intact[((intact > low) & (intact < high)).all(axis=1)]
    # Some thousand points are enough, without those outside the background, which may be made round the site alone.
    # Points close to the rim may lie on either side.
    few = near[:: max(1, len(near) // 4000)]
    few = few[is_inside(few, background)]
    few = few[cKDTree(surface.vertices).query(few, workers=count_threads())[0] > 3 * tolerance] if len(few) else few
    inside = [float(is_inside(few, mesh).mean()) if len(few) else 0.0 for mesh in candidates]
    best = int(np.argmin(inside))
    if inside[best] > 0.02:
        raise NotSeparatedError(
            f"both sides of the damage surface hold intact points (at least {inside[best]:.0%} of them)",
            method="implicit",
        )
    if len(candidates) > 1 and max(inside) - inside[best] < LEAST_DIFFERENCE:
        raise StageError(
            f"the intact points do not show which side is lost: the two sides hold {inside[0]:.0%} and {inside[1]:.0%}",
            method="implicit",
        )
    if (wrong := _measure_wrong_side(candidates[best], len(surface.faces), tolerance)) > MOST_WRONG:
        raise StageError(
            f"the strip to the background crosses the damage surface ({wrong:.0%} of it is on the wrong side)",
            method="implicit",
        )
    return candidates[best]


def orient_by_intact(surface: Surface, rims: Rims, intact: Floats) -> tuple[Surface, Rims]:
    """The surface, each piece turned so that its normals point away from the intact points beside its rim; and the
    rims, turned with it.

    A piece stays as it is where the intact points lie nearly in its plane, as on shallow damage.
    """
    from scipy.spatial import cKDTree

    if not len(intact) or not rims.loops:
        return surface, rims
    label, size = label_bodies(surface.faces)
    nodes = np.concatenate(rims.loops)
    count = min(BESIDE, len(intact))
    beside = np.asarray(cKDTree(intact).query(surface.vertices[nodes], count, workers=count_threads())[1]).reshape(
        len(nodes), count
    )
    # The nearest points lie above the rim, which ends a tolerance below the skin; the farther ones lie beside it.
    way = intact[beside[:, count // 2 :]] - surface.vertices[nodes][:, None]
    lean = np.einsum("ijk,ik->ij", way, surface.vertex_normals[nodes]) / np.maximum(np.linalg.norm(way, axis=2), 1e-300)
    piece_of = np.zeros(len(surface.vertices), dtype=np.int64)
    piece_of[surface.faces] = label[:, None]
    balance = np.bincount(piece_of[nodes], lean.mean(axis=1), size)
    wrong = balance > 0.1 * np.bincount(piece_of[nodes], np.abs(lean).mean(axis=1), size)
    faces = np.where(wrong[label][:, None], surface.faces[:, ::-1], surface.faces)
    loops = tuple(loop[::-1] if wrong[piece_of[loop[0]]] else loop for loop in rims.loops)
    return Surface(surface.vertices, faces), Rims(loops)


def measure_through(strips: Mesh, part: Part, tolerance: float) -> float:
    """Area of the strips that lies inside the part, deeper than twice the tolerance."""
    from damageest.geometry.distance import signed_distance

    area = strips.face_areas
    # Seven points of each triangle, because some are long: its centre, and points toward its corners and edges.
    share = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4], [3, 3, 0], [3, 0, 3], [0, 3, 3]], dtype=np.float64)
    share /= share.sum(axis=1)[:, None]
    points = np.einsum("sc,fck->fsk", share, strips.triangles)
    depth = -signed_distance(points.reshape(-1, 3), part)[0].reshape(len(area), -1)
    return float((area * (depth > 2 * tolerance).mean(axis=1)).sum())


def _measure_wrong_side(mesh: Mesh, count: int, tolerance: float) -> float:
    """Share of the first ``count`` faces, checked on up to a thousand of them, that do not have the inside of the mesh
    behind them and the outside in front.

    Finds a strip that crosses the surface, and a cut background that overlaps itself.
    """
    chosen = np.unique(np.linspace(0, count - 1, min(count, 1000)).astype(np.int64))
    middle = mesh.triangles[chosen].mean(axis=1)
    step = mesh.cross[chosen]
    step = step * (0.5 * tolerance / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
    behind, front = (winding_number(middle + sign * step, mesh) for sign in (-1, 1))
    right = (np.abs(behind - 1) < 0.5) & (np.abs(front) < 0.5)
    return float(1 - right.mean())

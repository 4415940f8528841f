"""The bodies into which a damage surface divides the part, and which of them are lost."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part, Surface
from damageest.errors import StageError
from damageest.geometry.bodies import label_pieces
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.loops import trace_loops
from damageest.geometry.solids import compose_shells, to_arrays, to_manifold
from damageest.geometry.vectors import normalise
from damageest.stages.enclose import NotSeparatedError
from damageest.stages.enclose._outside import Sheet

THIN = 2e-4
"""Half of the thickness of the cut, in tolerances."""
UPRIGHT = 0.5
"""Cosine between a face's normal and that of its corner, at least, where the sheet does not fold."""
MOST_BOTH = 0.02
"""Area of a body on the second side of the damage surface, at most, as a share of the surface."""
MOST_INTACT = 0.02
"""Share of the intact points that may lie on the lost bodies."""
LEAST_DIFFERENCE = 0.1
"""By how much the shares of intact points on the two sides must differ."""
MOST_ASKED = 4000
"""Intact points that are looked at."""
BESIDE = 3.0
"""Distance from the damage surface, in tolerances, from which an intact point tells the side."""
LEAST_AREA = 1e-6
"""Area of a body on the damage surface, as a share of that, from which it touches it."""
OPENED = (1.1, 1.6, 2.4, 3.6)
"""How wide the metal is opened where the border of the sheet lies in the part, in depths, one after the other until
the two sides are apart. Where the wall beside it is thin, its last bit has no border."""


def divide_part(part: Part, sheet: Sheet, intact: Floats, side: str, tolerance: float) -> tuple[Any, Any]:
    """The lost metal and what is left, as Manifolds relative to the middle of the part's bounds.

    Args:
        part: as designed.
        sheet: the damage surface, extended until it ends outside the part.
        intact: (K,3) points on the intact skin, in the part's frame.
        side: auto, smaller or larger.
        tolerance: in the part's unit.

    Raises NotSeparatedError where the surface does not divide the part; StageError where the side is not shown.
    """
    origin = part.bounds.mean(axis=0)
    body = to_manifold(part, origin) - to_manifold(_thicken(sheet.own, THIN * tolerance), origin)
    loose = np.ones(len(sheet.mesh.faces), bool)
    loose[: len(sheet.own.faces)] = _find_folds(sheet.own)
    body -= _thicken_each(sheet.mesh.triangles[loose] - origin, 2 * THIN * tolerance)
    piece = label_pieces(sheet.own.faces)
    for wide in OPENED if len(sheet.places) else OPENED[:1]:
        bodies = (body - _make_balls(sheet.places - origin, wide * sheet.deep)).decompose()
        meshes = [Mesh(*to_arrays(one, origin)) for one in bodies]
        area = _align_sides(np.array([_measure_sides(mesh, sheet, piece, tolerance) for mesh in meshes]))
        if area.min(axis=1).max(initial=0.0) < MOST_BOTH * sheet.mesh.area:  # a pocket in a fold has both sides
            break
    else:
        raise NotSeparatedError("the damage surface does not divide the part in two", method="implicit")
    touched = area.sum(axis=1) > LEAST_AREA * sheet.mesh.area
    front, back = touched & (area[:, 0] > area[:, 1]), touched & (area[:, 0] <= area[:, 1])
    if not front.any() or not back.any():
        raise NotSeparatedError("the damage surface cuts nothing off the part", method="implicit")
    lost = (front, back)[_choose_side(meshes, bodies, (front, back), intact, side, sheet, tolerance)]
    return _unite(bodies, lost), _unite(bodies, ~lost)


def _thicken(surface: Surface, half: float) -> Mesh:
    """A closed mesh that has the surface in its middle and is ``2 half`` thick."""
    away, count = half * surface.vertex_normals, len(surface.vertices)
    vertices = np.concatenate([surface.vertices + away, surface.vertices - away])
    walls = [surface.faces, surface.faces[:, ::-1] + count]
    for loop in trace_loops(surface.faces):
        after = np.roll(loop, -1)
        walls.append(np.stack([after, loop, loop + count], axis=1))
        walls.append(np.stack([after, loop + count, after + count], axis=1))
    return Mesh(vertices, np.concatenate(walls))


def _find_folds(surface: Mesh) -> Flags:
    """(F,) the faces that lean away from the normal at one of their corners: there `_thicken` is too thin, or inside
    out."""
    normal = normalise(surface.cross)
    return np.asarray((np.einsum("fij,fj->fi", surface.vertex_normals[surface.faces], normal) < UPRIGHT).any(axis=1))


def _thicken_each(triangles: Floats, half: float) -> Any:
    """The union of all triangles (F,3,3), each ``half`` thicker all round: also right where they fold."""
    from manifold3d import Manifold, OpType

    octahedron = half * np.concatenate([np.eye(3), -np.eye(3)])
    corners = (triangles[:, :, None] + octahedron).reshape(len(triangles), 18, 3)
    return Manifold.batch_boolean([Manifold.hull_points(each) for each in corners] or [Manifold()], OpType.Add)


def _make_balls(places: Floats, radius: Floats) -> Any:
    """Balls round the places (K,3) where the border of the sheet still lies in the part: they open the metal between
    it and the outside, which would join the two sides of the sheet. A ball that others nearly hold is left out."""
    from manifold3d import Manifold, OpType

    kept: list[int] = []
    for number in np.argsort(-radius).tolist():
        gap = np.linalg.norm(places[kept] - places[number], axis=1)
        if not (gap < 0.4 * radius[kept]).any():
            kept.append(number)
    balls = [Manifold.sphere(float(radius[k]), 16).translate(tuple(places[k])) for k in kept]
    return Manifold.batch_boolean(balls or [Manifold()], OpType.Add)


def _measure_sides(mesh: Mesh, sheet: Sheet, piece: Ints, tolerance: float) -> Floats:
    """(P,2) the area of a body's faces on the front and on the back of each piece of the damage surface, without what
    extends it. ``piece``: the number of the piece of each face of the surface."""
    distance, face, _ = closest_on_mesh(mesh.triangles.mean(axis=1), sheet.mesh)
    at = np.flatnonzero((distance < 3 * THIN * tolerance) & (face < len(sheet.own.faces)))
    own, other = mesh.cross[at], sheet.mesh.cross[face[at]]
    size = np.linalg.norm(own, axis=1)
    lean = np.einsum("ij,ij->i", own, other) / np.maximum(size * np.linalg.norm(other, axis=1), 1e-300)
    label, count = piece[face[at]], int(piece.max()) + 1
    sides = [np.bincount(label, np.where(which, size / 2, 0), count) for which in (lean < -0.9, lean > 0.9)]
    return np.stack(sides, axis=1)


def _align_sides(area: Floats) -> Floats:
    """(B,2) the area of each body on the two sides of the damage surface, from that by piece (B,P,2).

    Pieces that bound a loss together, as the two ends of a bar that is gone, may face opposite ways. They are turned so
    that the same bodies lie before them: the signs of the strongest pattern of the differences.
    """
    turned = np.linalg.svd(area[..., 0] - area[..., 1])[2][0] < 0
    return np.asarray(np.where(turned[:, None], area[..., ::-1], area).sum(axis=1))


def _choose_side(
    meshes: list[Mesh], bodies: list[Any], sides: tuple[Flags, Flags], intact: Floats, side: str, sheet: Sheet,
    tolerance: float,
) -> int:  # fmt: skip
    """0 where the bodies of the first side are lost, 1 for the second one."""
    if side != "auto":
        volume = np.array([one.volume() for one in bodies])
        return int((volume[sides[0]].sum() < volume[sides[1]].sum()) != (side == "smaller"))
    few = intact[:: max(1, len(intact) // MOST_ASKED)]
    if len(few):  # points beside the rim may lie on either side
        few = few[closest_on_mesh(few, sheet.mesh)[0] > BESIDE * tolerance]
    shares = [0.0, 0.0]
    if len(few):
        owner = np.argmin([closest_on_mesh(few, mesh)[0] for mesh in meshes], axis=0)
        shares = [float(one[owner].mean()) for one in sides]
    best = int(np.argmin(shares))
    if shares[best] > MOST_INTACT:
        raise NotSeparatedError(
            f"both sides of the damage surface hold intact points (at least {shares[best]:.0%} of them)",
            method="implicit",
        )
    if abs(shares[0] - shares[1]) < LEAST_DIFFERENCE:
        raise StageError(
            f"the intact points do not show which side is lost: the two sides hold {shares[0]:.0%} and {shares[1]:.0%}",
            "enclose: {use: divide, side: smaller} or side: larger, where you know",
            method="implicit",
        )
    return best


def _unite(bodies: list[Any], which: Flags) -> Any:
    """The bodies, and all cavities: one that lies in another body takes nothing away."""
    return compose_shells([one for one, is_in in zip(bodies, which, strict=True) if is_in or one.volume() < 0])

"""Finds the exact deposit of a site: its exact damage volume, with stock that is the offset of its CAD faces.

The mesh's stock is a quarter of the tolerance higher than the job asks for, so that facets are nowhere lower. So stock
of that height is built too, and compared with the mesh; what is written has the height that the job asks for.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from damageest.artefacts import Deposit, Floats, Ints, Mesh, Part, Solid
from damageest.errors import InputError
from damageest.geometry.bodies import split_bodies
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh, is_inside, signed_distance
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.vectors import normalise
from damageest_cadquery._check import ON_CAD, VOLUME, is_plane, measure_area
from damageest_cadquery._cut import find_rim
from damageest_cadquery._read import explore
from damageest_cadquery._solids import StockError, combine, explore_faces, sew
from damageest_cadquery._split import (
    Origin,
    Piece,
    ShapeMap,
    find_corners,
    is_opencascade_error,
    is_sound,
    is_watertight,
    measure_volume,
    note_images,
    triangulate,
)
from damageest_cadquery._stock import Base, build_parts, build_stock, take_bases

STOCK = -2
"""In origins: (number, STOCK) is the offset of a CAD face, (-1, STOCK) a side of the stock."""
BEYOND = 0.02
"""Largest share of the stock's surface that may be farther than a quarter tolerance from the mesh's."""
OUTLINE, FARTHEST = 1.5, 4.0
"""Nearer than the first to the outline of the damage, in tolerances, only the second counts: sides stand on the outline
of the exact damage volume, which the mesh rounds, or draws out where the loss fades. It counts on the skin: over a
convex face the sides are farther apart by as much as the offset is longer than the face."""
SAME = 5e-4
"""Largest relative difference between the volume of the deposit and those of its parts, all of them as triangles: of
splines with long outlines OpenCASCADE's integrals are wrong by some tenths of a percent."""
ENTERED = 1e-4
"""Share of the deposit's volume that the stock may have in the metal that is left."""
SAMPLES = 6000
SPECK = 1e-3


@dataclass(frozen=True, eq=False)
class ExactDeposit:
    """``volume``; ``distance``: 95 % of the stock's surface, but for that near the damage's outline, are as near to
    the mesh's, both ways; ``farthest``: all; ``difference``: of the stock's volumes, as a share of the mesh deposit.

    The latter three are those of stock as high as the mesh's.
    """

    pieces: tuple[Piece, ...]
    volume: float
    distance: float
    farthest: float
    difference: float
    seconds: float


def find_deposit(
    deposit: Solid,
    lost: Solid,
    damage: Sequence[Piece],
    rest: Sequence[Piece],
    faces: Sequence[Any],
    part: Part,
    tolerance: float,
) -> ExactDeposit:
    """The exact form of ``deposit``, on the exact ``damage`` volume of the mesh ``lost``.

    Raises StockError where there is none that passes the checks.
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

    start = time.process_time()
    if not isinstance(deposit, Deposit) or (deposit.stock_volume > 0 and not deposit.heights):
        raise StockError("the allowance does not say how high the stock on each CAD face is")
    if deposit.overlap:
        raise StockError("the stock overlaps the intact skin around the damage")
    # OpenCASCADE adds curves to the edges that it works with, which what is left of the part shares
    damage = [replace(piece, shape=BRepBuilderAPI_Copy(piece.shape).Shape()) for piece in damage]
    try:
        bases = [base for piece in damage for base in take_bases(piece, dict(deposit.heights))]
        higher = [replace(base, height=base.height + tolerance / 4) for base in bases]
        figures = _compare(higher, deposit, lost, part, tolerance)
        stock = _build(bases, damage, rest, part, tolerance, deposit)
        pieces = _join(damage, stock, bases, faces, part, tolerance) if stock else tuple(damage)
        whole = sum(triangulate(piece.shape, tolerance / 16).volume for piece in pieces)
        wrong = min(
            (whole / volume - 1 for volume in _measure_parts([*(piece.shape for piece in damage), *stock], tolerance)),
            key=abs,
        )
    except Exception as error:
        if is_opencascade_error(error) or isinstance(error, (InputError, ValueError)):
            raise StockError(f"OpenCASCADE cannot build it ({str(error)[:80] or type(error).__name__})") from None
        raise
    volume = sum(measure_volume(piece.shape) for piece in pieces)
    if abs(wrong) > SAME:
        raise StockError(f"its volume differs by {wrong:+.2%} from damage and stock")
    bodies = sum(body.volume > SPECK * deposit.volume for body in split_bodies(deposit))
    if len(pieces) != bodies:
        raise StockError(f"{len(pieces)} solids for {bodies} pieces")
    if not is_sound(pieces):
        raise StockError("not valid (BRepCheck)")
    return ExactDeposit(pieces, volume, *figures, time.process_time() - start)


def _measure_parts(shapes: Sequence[Any], tolerance: float) -> tuple[float, float]:
    """The sum of the volumes of solids, and the volume of their union, by triangles: where solids of an assembly touch,
    the stock on one lies in the other. The union loses what the chords of touching faces have in common."""
    from manifold3d import Manifold, OpType

    meshes = [triangulate(shape, tolerance / 16) for shape in shapes]
    origin = meshes[0].bounds.mean(axis=0)
    union = Manifold.batch_boolean([to_manifold(mesh, origin) for mesh in meshes], OpType.Add)
    return sum(mesh.volume for mesh in meshes), union.volume()


def _build(
    bases: Sequence[Base], damage: Sequence[Piece], rest: Sequence[Piece], part: Part, tolerance: float, deposit: Solid
) -> list[Any]:
    """The stock, without what would lie in the metal that is left."""
    if not bases:
        return []
    stock = build_stock(bases)
    origin = deposit.bounds.mean(axis=0)
    whole, entered = to_manifold(part, origin), 0.0
    for solid in stock:
        entered += (to_manifold(triangulate(solid, tolerance / 16), origin) ^ whole).volume()
    if entered <= _bound_entered(bases, part, deposit):
        return stock
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.TopAbs import TopAbs_SOLID

    metal = [piece.shape for piece in (*rest, *damage)]
    cut = explore(combine(BRepAlgoAPI_Cut(), stock, metal), TopAbs_SOLID)
    return [solid for solid in cut if measure_volume(solid) > 1e-6 * deposit.volume]


def _bound_entered(bases: Sequence[Base], part: Part, deposit: Solid) -> float:
    """The volume of stock that may lie within the triangles of the part: their chords, and rounding errors."""
    curved = sum(measure_area(base.face) for base in bases if not is_plane(base.face))
    return ENTERED * deposit.volume + part.tessellation_error * curved


def _compare(
    bases: Sequence[Base], deposit: Deposit, lost: Solid, part: Part, tolerance: float
) -> tuple[float, float, float]:
    """Distance, largest distance and difference of volumes between stock, as high as the mesh's, and the mesh's. Its
    parts are joined as triangles, which takes a second where OpenCASCADE takes a minute."""
    from manifold3d import Manifold, OpType

    parts = build_parts(bases) if bases else []
    origin = deposit.bounds.mean(axis=0)
    solids = [to_manifold(triangulate(solid, tolerance / 16), origin) for solid in parts]
    stock = Manifold.batch_boolean(solids, OpType.Add) if solids else Manifold()
    whole = to_manifold(part, origin)
    if (stock ^ whole).volume() > _bound_entered(bases, part, deposit):
        stock -= whole
    volume = stock.volume()
    difference = (volume - deposit.stock_volume) / deposit.volume
    outside = np.flatnonzero(~find_inner_faces(lost, part))
    wider = _compare_outlines(bases, lost, outside, part) / deposit.volume
    curved = sum(measure_area(face) for solid in parts for face in explore_faces(solid) if not is_plane(face))
    if abs(difference - wider) > VOLUME + part.tessellation_error * curved / deposit.volume:
        raise StockError(
            f"the volume of its stock differs by {difference:+.2%} of the deposit, of which the outline of the damage "
            f"explains {wider:+.2%}"
        )
    if stock.is_empty():
        return 0.0, 0.0, difference
    vertices, faces = to_arrays(stock)
    made = Mesh(vertices + origin, faces)
    rim = cKDTree(lost.vertices[np.unique(find_rim(lost.faces[outside]))])
    assert part.faces_brep is not None
    stretch = _measure_stretch(bases, 1 + max([int(part.faces_brep.max()), *(base.number for base in bases)]))
    far: list[Any] = []
    off: list[Floats] = []
    strayed = False
    for one, other in ((made, deposit), (deposit, made)):
        points, foot, number = _sample_above(one, part, tolerance)
        off.append(distance_to_mesh(points, other))
        far.append(np.asarray(rim.query(foot)[0]) > OUTLINE * tolerance)
        strayed |= bool((off[-1] > FARTHEST * tolerance * np.where(far[-1], 1.0, stretch[number])).any())
    farthest = float(max(each.max(initial=0.0) for each in off))
    beyond = max(
        float((each[away] > tolerance / 4).mean()) if away.any() else 0.0 for each, away in zip(off, far, strict=True)
    )
    if beyond > BEYOND or strayed:
        raise StockError(f"its stock is up to {farthest:.3g} from the mesh, {beyond:.1%} more than a quarter tolerance")
    inside = [each[away] for each, away in zip(off, far, strict=True)]
    return float(max(np.quantile(each, 0.95) if len(each) else 0.0 for each in inside)), farthest, difference


def _compare_outlines(bases: Sequence[Base], lost: Solid, outside: Ints, part: Part) -> float:
    """By how much stock is larger because the exact damage volume has more skin than the mesh."""
    assert part.faces_brep is not None
    corners = lost.triangles[outside]
    number = part.faces_brep[closest_on_mesh(corners.mean(axis=1), part)[1]]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    heights = {base.number: base.height for base in bases}
    more = sum(base.height * measure_area(base.face) for base in bases)
    return more - sum(height * float(areas[number == face].sum()) for face, height in heights.items())


def _measure_stretch(bases: Sequence[Base], count: int) -> Floats:
    """(F,) by how much longer the offset of each CAD face is at most than the face, at the border of its stock."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
    from OCP.BRepLProp import BRepLProp_SLProps
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
    from OCP.TopoDS import TopoDS

    stretch = np.ones(count)
    for base in bases:
        properties = BRepLProp_SLProps(BRepAdaptor_Surface(base.face, False), 2, 1e-7)
        sign = 1.0 if base.face.Orientation() == TopAbs_REVERSED else -1.0  # curvatures count towards the normal
        for edge in explore(base.face, TopAbs_EDGE):
            curve = BRepAdaptor_Curve2d(TopoDS.Edge_s(edge), base.face)
            for at in np.linspace(curve.FirstParameter(), curve.LastParameter(), 9).tolist():
                place = curve.Value(at)
                properties.SetParameters(place.X(), place.Y())
                if properties.IsCurvatureDefined():
                    bend = max(sign * properties.MinCurvature(), sign * properties.MaxCurvature())
                    stretch[base.number] = max(stretch[base.number], 1 + base.height * bend)
    return stretch


def _sample_above(mesh: Mesh, part: Part, tolerance: float) -> tuple[Floats, Floats, Ints]:
    """(N,3) places on a mesh, evenly by area, that lie above the part's skin; (N,3) the nearest places on it, and (N,)
    the CAD faces that these are on."""
    assert part.faces_brep is not None
    rng = np.random.default_rng(31)
    total = np.cumsum(np.linalg.norm(mesh.cross, axis=1))
    face = np.minimum(np.searchsorted(total, rng.random(SAMPLES) * total[-1], side="right"), len(total) - 1)
    u, v = np.sqrt(rng.random((SAMPLES, 1))), rng.random((SAMPLES, 1))
    a, b, c = np.moveaxis(mesh.triangles[face], 1, 0)
    points = np.asarray(a * (1 - u) + b * u * (1 - v) + c * u * v)
    normals = np.asarray(normalise(mesh.cross[face]))
    above = signed_distance(points, part)[0] > tolerance / 8
    points, normals = points[above], normals[above]
    # between parts that touch, their chords leave slits
    points = points[~is_inside(points + tolerance / 4 * normals, mesh)]
    points = points[~is_inside(points, part)]  # near edges in which solids touch, the sign above can be wrong
    if not len(points):
        return points, points, np.empty(0, np.int64)
    _, nearest, foot = closest_on_mesh(points, part)
    return points, foot, part.faces_brep[nearest]


def _join(
    damage: Sequence[Piece],
    stock: Sequence[Any],
    bases: Sequence[Base],
    faces: Sequence[Any],
    part: Part,
    tolerance: float,
) -> tuple[Piece, ...]:
    """Damage volume and stock as one, with the origins of their faces."""
    solids, known = _unite(damage, stock, tolerance / 16)
    heights = {base.number: base.height for base in bases}
    pieces = []
    for solid in solids:
        mine = explore_faces(solid)
        origins = [known.get(face) or _find_top(face, heights, faces, ON_CAD * part.diagonal) for face in mine]
        pieces.append(Piece(solid, damage[0].owner, tuple(origins)))
    # in a concave corner the stock of one face can cover that of another
    if not any(number >= 0 and kind == STOCK for piece in pieces for number, kind in piece.origins):
        raise StockError("no face lies at the height of the stock over a face of the part")
    return tuple(pieces)


def _unite(damage: Sequence[Piece], stock: Sequence[Any], chord: float) -> tuple[list[Any], ShapeMap]:
    """The solids but for specks, and the origins of the faces that come from the damage volume. Solids that only touch
    are sewn; where more solids than the damage has are left, or their triangles do not close within ``chord``, all are
    fused."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.TopAbs import TopAbs_SOLID

    known, shapes = ShapeMap(), [piece.shape for piece in damage]
    found = sew([*shapes, *stock])
    least = SPECK * sum(measure_volume(shape) for shape in stock)
    solids, rows = found or ([], ShapeMap())
    solids = [solid for solid in solids if measure_volume(solid) > least]
    if 0 < len(solids) <= len(damage) and all(is_watertight(solid, chord) for solid in solids):
        for face in (face for solid in solids for face in explore_faces(solid)):
            number, k = rows.get(face, (len(damage), 0))
            if number < len(damage):
                known.set(face, damage[number].origins[k])
        return solids, known
    algorithm = BRepAlgoAPI_Fuse()
    shape = combine(algorithm, shapes, list(stock))
    for piece in damage:
        for face, origin in zip(explore_faces(piece.shape), piece.origins, strict=True):
            note_images(known, algorithm, face, origin)
    return [solid for solid in explore(shape, TopAbs_SOLID) if measure_volume(solid) > least], known


def _find_top(face: Any, heights: Mapping[int, float], faces: Sequence[Any], near: float) -> Origin:
    """The CAD face of which a face is the offset: all its corners lie at the height of the stock over it."""
    from OCP.BRep import BRep_Tool
    from OCP.gp import gp_Pnt
    from OCP.ShapeAnalysis import ShapeAnalysis_Surface
    from OCP.TopoDS import TopoDS

    corners = [gp_Pnt(*point) for point in find_corners(face).tolist()]
    for number, height in heights.items():
        analysis = ShapeAnalysis_Surface(BRep_Tool.Surface_s(TopoDS.Face_s(faces[number])))
        for corner in corners:
            analysis.ValueOfUV(corner, 1e-7)
            if abs(analysis.Gap() - height) > near:
                break
        else:
            return number, STOCK
    return -1, STOCK

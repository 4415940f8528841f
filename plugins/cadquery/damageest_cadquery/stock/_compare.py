"""Compares the exact stock of a deposit with the mesh's: volume, and distances both ways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from damageest.artefacts import Deposit, Floats, Ints, Mesh, Part, Solid
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh, is_inside, signed_distance
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_arrays, to_manifold, unite
from damageest.geometry.vectors import cross_corners, normalise
from damageest_cadquery.cutting.check_pieces import VOLUME
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.face_measures import is_plane, measure_area
from damageest_cadquery.solids.joining import StockError, explore_faces
from damageest_cadquery.solids.split import Piece, triangulate
from damageest_cadquery.stock._join import Lump
from damageest_cadquery.stock._own_skin import build_own_stock, is_plain
from damageest_cadquery.stock.offset_faces import Base
from damageest_cadquery.surfaces.open_surface import find_rim

BEYOND = 0.02
"""Largest share of the stock's surface that may be farther than a quarter tolerance from the mesh's."""
OUTLINE, FARTHEST = 1.5, 4.0
"""Nearer than the first to the outline of the damage, in tolerances, only the second counts: sides stand on the outline
of the exact damage volume, which the mesh rounds, or draws out where the loss fades. It counts on the skin: over a
convex face the sides are farther apart by as much as the offset is longer than the face."""
EXPLAINED = 0.05
"""Largest share of the deposit that another outline of the damage may be."""
ENTERED = 1e-4
"""Share of the deposit's volume that the stock may have in the metal that is left."""
SAMPLES = 6000


def bound_entered(bases: Sequence[Base], part: Part, deposit: Solid) -> float:
    """The volume of stock that may lie within the triangles of the part: their chords, and rounding errors."""
    curved = sum(measure_area(base.face) for base in bases if not is_plane(base.face))
    return ENTERED * deposit.volume + part.tessellation_error * curved


def compare_stock(
    damage: Sequence[Piece],
    bases: Sequence[Base],
    lumps: Sequence[Lump],
    deposit: Deposit,
    lost: Solid,
    part: Part,
    tolerance: float,
) -> tuple[float, float, float]:
    """Distance, largest distance and difference of volumes between stock on an exact ``damage`` volume, and the mesh's.
    Its parts, ``lumps``, are joined as triangles, which takes a second where OpenCASCADE takes a minute.

    Raises StockError where it differs too much, also from what the stage builds on the exact damage volume's own skin.
    """
    parts = [lump.solid for lump in lumps]
    origin = deposit.bounds.mean(axis=0)
    stock = unite([triangulate(solid, tolerance / 16) for solid in parts], origin)
    whole = to_manifold(part, origin)
    entered = (stock ^ whole).volume() > bound_entered(bases, part, deposit)
    stock = stock - whole if entered else stock
    difference = (stock.volume() - deposit.stock_volume) / deposit.volume
    outside = np.flatnonzero(~find_inner_faces(lost, part))
    skin = _leave_touching(lost, outside, part, tolerance)
    wider = _compare_outlines(bases, lost, skin, part) / deposit.volume
    curved = sum(measure_area(face) for solid in parts for face in explore_faces(solid) if not is_plane(face))
    room = VOLUME + part.tessellation_error * curved / deposit.volume
    fault: StockError | None = None
    distance = farthest = 0.0
    if not stock.is_empty():
        distance, farthest, fault = _compare_surfaces(bases, stock, deposit, lost, outside, part, tolerance)
    if abs(difference - wider) > room:
        fault = StockError(
            f"its volume differs by {difference:+.2%} of the deposit, of which the outline of the damage "
            f"explains {wider:+.2%}",
            _find_worst(stock, deposit, part, tolerance, origin),
        )
    if fault is not None:
        plain = abs(difference) <= EXPLAINED and is_plain(deposit, lost, skin, part, tolerance, VOLUME * deposit.volume)
        own = build_own_stock(damage, deposit, whole if entered else None, tolerance) if plain else None
        if own is None or not _is_same(stock, own, room, deposit, part, tolerance):
            raise fault
    return distance, farthest, difference


def _leave_touching(lost: Solid, outside: Ints, part: Part, tolerance: float) -> Ints:
    """The faces ``outside`` (F,) of ``lost`` without those that touch another solid of the part: they get no stock, and
    the CAD face nearest to them may be that of the other solid."""
    above = lost.triangles[outside].mean(axis=1) + tolerance / 8 * lost.face_normals[outside]
    return outside[~is_inside(above, part)]


def _compare_surfaces(
    bases: Sequence[Base], stock: Any, deposit: Deposit, lost: Solid, outside: Ints, part: Part, tolerance: float
) -> tuple[float, float, StockError | None]:
    """Distance and largest distance between the surfaces of stock and of the mesh's stock, and why it is refused."""
    made = _take_mesh(stock, deposit.bounds.mean(axis=0))
    rim = cKDTree(lost.vertices[np.unique(find_rim(lost.faces[outside]))])
    assert part.faces_brep is not None
    stretch = _measure_stretch(bases, 1 + max([int(part.faces_brep.max()), *(base.number for base in bases)]))
    far: list[Any] = []
    off: list[Floats] = []
    on: list[Ints] = []
    strayed: set[int] = set()
    for one, other in ((made, deposit), (deposit, made)):
        points, foot, number = _sample_above(one, part, tolerance)
        off.append(distance_to_mesh(points, other))
        far.append(np.asarray(rim.query(foot)[0]) > OUTLINE * tolerance)
        on.append(number)
        bad = off[-1] > FARTHEST * tolerance * np.where(far[-1], 1.0, stretch[number])
        strayed |= set(number[bad].tolist())
    farthest = float(max(each.max(initial=0.0) for each in off))
    beyond = max(
        float((each[away] > tolerance / 4).mean()) if away.any() else 0.0 for each, away in zip(off, far, strict=True)
    )
    inside = [each[away] for each, away in zip(off, far, strict=True)]
    distance = float(max(np.quantile(each, 0.95) if len(each) else 0.0 for each in inside))
    if beyond <= BEYOND and not strayed:
        return distance, farthest, None
    apart = [n[away & (each > tolerance / 4)] for n, away, each in zip(on, far, off, strict=True)]
    fault = StockError(
        f"it is up to {farthest / tolerance:.2g} tolerances from the mesh's, {beyond:.1%} more than a quarter",
        strayed | (set(np.concatenate(apart).tolist()) if beyond > BEYOND else set()),
    )
    return distance, farthest, fault


def _is_same(stock: Any, reference: Any, room: float, deposit: Solid, part: Part, tolerance: float) -> bool:
    """Whether stock is the same as another on one skin, both about the middle of ``deposit``: by volume, and all of it
    near."""
    if stock.is_empty() or reference.is_empty():
        return False
    if abs(stock.volume() - reference.volume()) > room * deposit.volume:
        return False
    meshes = [_take_mesh(each, deposit.bounds.mean(axis=0)) for each in (stock, reference)]
    for one, other in (meshes, meshes[::-1]):
        off = distance_to_mesh(_sample_above(one, part, tolerance)[0], other)
        if off.max(initial=0.0) > tolerance or (off > tolerance / 4).mean() > BEYOND:
            return False
    return True


def _find_worst(stock: Any, deposit: Solid, part: Part, tolerance: float, origin: Floats) -> list[int]:
    """The CAD faces above which stock differs from the mesh's by a fifth of the most on a face, or more."""
    assert part.faces_brep is not None
    if stock.is_empty():
        return []
    made = _take_mesh(stock, origin)
    number = np.empty(0, np.int64)
    for one, other in ((made, deposit), (deposit, made)):
        points, _, faces = _sample_above(one, part, tolerance)
        number = np.append(number, faces[distance_to_mesh(points, other) > tolerance / 8])
    count = np.bincount(number, minlength=1)
    return np.flatnonzero(count > count.max() / 5).tolist() if count.max() else []


def _take_mesh(solid: Any, origin: Floats) -> Mesh:
    """The triangles of a Manifold about ``origin``."""
    vertices, triangles = to_arrays(solid)
    return Mesh(vertices + origin, triangles)


def _compare_outlines(bases: Sequence[Base], lost: Solid, outside: Ints, part: Part) -> float:
    """By how much stock is larger because the exact damage volume has more skin than the mesh."""
    assert part.faces_brep is not None
    corners = lost.triangles[outside]
    number = part.faces_brep[closest_on_mesh(corners.mean(axis=1), part)[1]]
    areas = np.linalg.norm(cross_corners(corners), axis=1) / 2
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
    total = np.cumsum(2 * mesh.face_areas)
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

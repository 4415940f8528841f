"""Finds the exact deposit of a site: its exact damage volume, with stock that is the offset of its CAD faces."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from damageest.artefacts import Deposit, Part, Solid
from damageest.errors import InputError
from damageest.geometry.bodies import split_bodies
from damageest.geometry.solids import to_manifold
from damageest_cadquery.cutting.check_pieces import INVALID, ON_CAD
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.joining import (
    StockError,
    combine,
    explore_faces,
    naming,
    settle_edges,
    sew,
    turn_offsets,
)
from damageest_cadquery.solids.split import (
    Origin,
    Piece,
    ShapeMap,
    copy_pieces,
    find_corners,
    is_sound,
    is_watertight,
    measure_volume,
    note_images,
    triangulate,
)
from damageest_cadquery.stock._compare import bound_entered, compare_stock
from damageest_cadquery.stock.offset_faces import Base, build_parts, build_stock, take_bases

STOCK = -2
"""In origins: (number, STOCK) is the offset of a CAD face, (-1, STOCK) a side of the stock."""
SAME = 5e-4
"""Largest relative difference between the volume of the deposit and those of its parts, all of them as triangles: of
splines with long outlines OpenCASCADE's integrals are wrong by some tenths of a percent."""
SPECK = 1e-3
"""Share of a volume up to which a body of it does not count where their number is compared with the mesh's."""


@dataclass(frozen=True, eq=False)
class ExactDeposit:
    """``volume``; ``distance``: 95 % of the stock's surface, but for that near the damage's outline, are as near to
    the mesh's, both ways; ``farthest``: all; ``difference``: of the stock's volumes, as a share of the mesh deposit.
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
    start = time.process_time()
    if not isinstance(deposit, Deposit) or (deposit.stock_volume > 0 and not deposit.heights):
        raise StockError("the allowance does not say how high the stock on each CAD face is")
    if deposit.overlap:
        raise StockError("the stock overlaps the intact skin around the damage")
    damage = copy_pieces(damage)
    heights = dict(deposit.heights)
    numbers = {number for piece in damage for number, _ in piece.origins if heights.get(number, 0.0) > 0}
    with naming(numbers):
        try:
            bases = [base for piece in damage for base in take_bases(piece, dict(deposit.heights))]
            parts = build_parts(bases) if bases else []
            figures = compare_stock(damage, bases, parts, deposit, lost, part, tolerance)
            stock = _build(bases, damage, rest, part, tolerance, deposit)
            pieces = _join(damage, stock, bases, faces, part, tolerance) if stock else tuple(damage)
            whole = sum(triangulate(piece.shape, tolerance / 16).volume for piece in pieces)
            wrong = min(
                (
                    whole / volume - 1
                    for volume in _measure_parts([*(piece.shape for piece in damage), *stock], tolerance)
                ),
                key=abs,
            )
        except (InputError, ValueError) as error:
            raise StockError(f"its triangles do not close ({str(error)[:80]})") from None
        volume = sum(measure_volume(piece.shape) for piece in pieces)
        if abs(wrong) > SAME:
            raise StockError(f"its volume differs by {wrong:+.2%} from damage and stock")
        bodies = sum(body.volume > SPECK * deposit.volume for body in split_bodies(deposit))
        solids = sum(measure_volume(piece.shape) > SPECK * deposit.volume for piece in pieces)
        # small bodies of the damage, which its own checks leave aside, may carry some stock
        specks = sum(measure_volume(piece.shape) <= SPECK * lost.volume for piece in damage)
        if not bodies <= solids <= bodies + specks:
            raise StockError(f"{solids} solids for {bodies} pieces")
        if not all(settle_edges(piece.shape) for piece in pieces) or not is_sound(pieces):
            raise StockError(INVALID, _find_invalid(pieces))
        return ExactDeposit(pieces, volume, *figures, time.process_time() - start)


def refuse_doubles(deposit: Solid | None, damage: Sequence[Piece], doubles: Sequence[Piece]) -> None:
    """Raises StockError where stock lies on faces of solids that the damage volume lies in twice: the mesh has one of
    two faces that coincide, which need not be that of the piece that was taken."""
    if not isinstance(deposit, Deposit):
        return
    wanted = {number for number, height in deposit.heights if height > 0}
    other = {number for piece in doubles for number, _ in piece.origins}
    if lost := (wanted & other) - {number for piece in damage for number, _ in piece.origins}:
        raise StockError("the CAD file holds this metal twice, in solids that overlap", lost)


def _find_invalid(pieces: Sequence[Piece]) -> list[int]:
    """The CAD faces of which a face in a solid comes that is not valid by itself; none where each is."""
    from OCP.BRepCheck import BRepCheck_Analyzer

    return [
        number
        for piece in pieces
        for face, (number, _) in zip(explore_faces(piece.shape), piece.origins, strict=True)
        if number >= 0 and not BRepCheck_Analyzer(face).IsValid()
    ]


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
    if entered <= bound_entered(bases, part, deposit):
        return stock
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.TopAbs import TopAbs_SOLID

    metal = [piece.shape for piece in (*rest, *damage)]
    cut = explore(combine(BRepAlgoAPI_Cut(), [turn_offsets(solid) for solid in stock], metal), TopAbs_SOLID)
    return [solid for solid in cut if measure_volume(solid) > 1e-6 * deposit.volume]


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
    shape = combine(algorithm, shapes, [turn_offsets(solid) for solid in stock])
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

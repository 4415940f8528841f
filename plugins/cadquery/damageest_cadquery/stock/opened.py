"""The exact form of a cavity that was opened before deposition, and of the metal that is milled off for it.

The cavity is cut out of the part's solids as a damage volume is, by the surface that milling leaves. What is to be
milled off is the cavity without the damage volume.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damageest.artefacts import Deposit, Floats, Part, Solid
from damageest.errors import InputError
from damageest.geometry.skin import extract_ids
from damageest.geometry.solids import to_manifold
from damageest_cadquery.cutting.check_pieces import INVALID, VOLUME
from damageest_cadquery.cutting.exact_damage import Exact, SiteInput
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.face_measures import is_plane, measure_area
from damageest_cadquery.solids.joining import StockError, combine, explore_faces, settle_edges
from damageest_cadquery.solids.split import (
    Origin,
    Piece,
    ShapeMap,
    copy_pieces,
    is_sound,
    measure_volume,
    note_images,
    triangulate,
)

FOUND = -5
"""In origins: (k, FOUND) is face k of the inner damage surface, on metal that is milled off."""
LOST = 0.01
"""Share of the metal to mill off, and of a tenth of the cavity, within which it has the volume of cavity without damage
volume, by triangles: those of curved faces differ where other edges bound them."""
CRUMB = 1e-3
"""Share of the milled metal below which a solid of it is dropped: the inner surfaces of cavity and damage are each as
near to the mesh's as the checks ask for, so sheets thinner than that lie between them."""


@dataclass(frozen=True, eq=False)
class ExactMilled:
    """``pieces``: what is to be milled off; ``volume``; ``seconds`` of the processor."""

    pieces: tuple[Piece, ...]
    volume: float
    seconds: float


def take_opened(site: SiteInput, part: Part) -> SiteInput | None:
    """The cavity of a site as what is to be cut out of the part; None where it was not opened."""
    deposit = site.deposit
    if not isinstance(deposit, Deposit) or deposit.milled is None:
        return None  # after a cut-back alone, the cavity is the damage volume of the site
    assert deposit.cavity is not None
    cavity = deposit.cavity
    # no scan has seen what milling leaves
    enclosures = () if deposit.opening is None else (deposit.opening,)
    return replace(
        site, damage=cavity, surface=extract_ids(cavity, part), enclosures=enclosures, points=np.empty((0, 3))
    )


def find_milled(cavity: Exact, damage: Exact, deposit: Deposit, part: Part, tolerance: float) -> ExactMilled:
    """The ``cavity`` without the ``damage`` volume. Raises StockError where no solid passes the checks."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.TopAbs import TopAbs_SOLID

    start = time.process_time()
    assert deposit.cavity is not None
    assert deposit.milled is not None
    opened, lost = copy_pieces(cavity.pieces), copy_pieces(damage.pieces)
    algorithm = BRepAlgoAPI_Cut()
    shape = combine(algorithm, [piece.shape for piece in opened], [piece.shape for piece in lost])
    known = ShapeMap()
    for piece in opened:
        for face, origin in zip(explore_faces(piece.shape), piece.origins, strict=True):
            note_images(known, algorithm, face, origin)
    for piece in lost:
        for face, (number, tool) in zip(explore_faces(piece.shape), piece.origins, strict=True):
            note_images(known, algorithm, face, (tool, FOUND) if tool >= 0 else (number, tool))
    solids = explore(shape, TopAbs_SOLID)
    volumes = [measure_volume(solid) for solid in solids]
    kept = [solid for solid, volume in zip(solids, volumes, strict=True) if volume > CRUMB * deposit.milled.volume]
    pieces = tuple(_take(solid, opened[0].owner, known) for solid in kept)
    if not pieces:
        raise StockError("OpenCASCADE leaves nothing of it")
    if not all(settle_edges(piece.shape) for piece in pieces) or not is_sound(pieces):
        raise StockError(INVALID)
    if any(origin == (-1, -1) for piece in pieces for origin in piece.origins):
        raise StockError("faces of unknown origin")
    volume = sum(measure_volume(piece.shape) for piece in pieces)
    # all of it as triangles, whose chords make the same of curved faces
    wanted, whole = _measure_difference(opened, lost, pieces, deposit.cavity.bounds.mean(axis=0), tolerance)
    if abs(whole + sum(volumes) - volume - wanted) > LOST * (wanted + deposit.cavity.volume / 10):
        raise StockError(f"its volume differs by {whole / wanted - 1:+.2%} from cavity without damage volume")
    room = VOLUME * deposit.cavity.volume + part.tessellation_error * _measure_curved(pieces)
    if abs(volume - deposit.milled.volume) > room:
        raise StockError(f"its volume differs by {volume / deposit.milled.volume - 1:+.2%}")
    return ExactMilled(pieces, volume, time.process_time() - start)


def _take(solid: Any, owner: int, known: ShapeMap) -> Piece:
    none: Origin = (-1, -1)
    return Piece(solid, owner, tuple(known.get(face, none) for face in explore_faces(solid)))


def _measure_difference(
    opened: Sequence[Piece], lost: Sequence[Piece], milled: Sequence[Piece], origin: Floats, tolerance: float
) -> tuple[float, float]:
    """The volumes of the cavity without the damage volume, and of what is milled off, by their triangles. Raises
    StockError where these do not close."""
    from manifold3d import Manifold, OpType

    def unite(pieces: Sequence[Piece]) -> Any:
        meshes: list[Solid] = [triangulate(piece.shape, tolerance / 16) for piece in pieces]
        return Manifold.batch_boolean([to_manifold(mesh, origin) for mesh in meshes], OpType.Add)

    try:
        return float((unite(opened) - unite(lost)).volume()), float(unite(milled).volume())
    except (InputError, ValueError) as error:
        raise StockError(f"its triangles do not close ({str(error)[:80]})") from None


def _measure_curved(pieces: Sequence[Piece]) -> float:
    """The area of curved CAD faces, which triangles cut off or add to."""
    from OCP.TopoDS import TopoDS

    return sum(
        measure_area(TopoDS.Face_s(face))
        for piece in pieces
        for face, (number, tool) in zip(explore_faces(piece.shape), piece.origins, strict=True)
        if tool == -1 and number >= 0 and not is_plane(TopoDS.Face_s(face))
    )

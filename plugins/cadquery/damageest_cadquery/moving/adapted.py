"""The CAD solids of a part that was adapted to its scan, checked against its mesh.

All faces are moved, not only those that a site touches: neighbours share edges, so a solid of which some faces were
moved would be open, and sites are cut out of closed solids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import DisplacementField, Floats, Part
from damageest.errors import InputError
from damageest.geometry.distance import distance_to_mesh
from damageest_cadquery.cutting.check_pieces import VOLUME
from damageest_cadquery.moving.moved import MoveError, move_solid
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.split import measure_volume, triangulate

AIM = 3e-7
"""Distance from the field, in diagonals of the part, within which moved faces follow it where few knots are enough."""
FOLLOWS = 0.1
"""Distance from the field, in tolerances, within which they must."""
MOST_COMPARED = 20_000
"""Places on the moved faces, about, that are compared with the mesh."""


@dataclass(frozen=True, eq=False)
class MovedSolids:
    """``solids``: OpenCASCADE shapes; ``off``: how far their corners and edges may lie off their faces, in mm."""

    solids: list[Any]
    off: float


def move_solids(solids: Sequence[Any], field: DisplacementField, part: Part, tolerance: float) -> MovedSolids:
    """The solids moved by the field, with their faces in their order. Lengths are in millimetres.

    ``part``: the adapted part. Raises MoveError where a face cannot follow the field, or where what results is no
    solid, or not the adapted part.
    """
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
    from OCP.TopoDS import TopoDS

    moved, first, off = [], 0, 0.0
    for solid in solids:
        moved.append(move_solid(solid, field.move, AIM * part.diagonal, FOLLOWS * tolerance, first))
        first += len(explore(solid, TopAbs_FACE))
        edges = (TopoDS.Edge_s(edge) for edge in explore(moved[-1], TopAbs_EDGE))
        off = max(off, max(BRep_Tool.Tolerance_s(edge) for edge in edges))
    require_sound(moved)
    require_same(moved, part, tolerance)
    return MovedSolids(moved, off)


def require_sound(solids: Sequence[Any]) -> None:
    """Raises MoveError where a solid is not valid and closed."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    for number, solid in enumerate(solids, 1):
        if not BRepCheck_Analyzer(solid).IsValid():
            raise MoveError(f"solid {number} is not valid after its faces were moved (BRepCheck)")
        shells = explore(solid, TopAbs_SHELL)
        if not shells or not all(BRep_Tool.IsClosed_s(TopoDS.Shell_s(shell)) for shell in shells):
            raise MoveError(f"solid {number} is not closed after its faces were moved")
        if measure_volume(solid) <= 0:
            raise MoveError(f"solid {number} is inside out after its faces were moved")


def require_same(solids: Sequence[Any], part: Part, tolerance: float) -> None:
    """Raises MoveError where the solids are not the adapted part, by volume and by the distance of places on them."""
    places: list[Floats] = []
    volume = 0.0
    for number, solid in enumerate(solids, 1):
        try:
            mesh = triangulate(solid, tolerance / 16)
        except (InputError, ValueError) as error:
            raise MoveError(f"triangles of solid {number} do not close after its faces were moved ({error})") from None
        places.append(mesh.vertices)
        volume += measure_volume(solid)
    samples = np.concatenate(places)
    samples = samples[:: max(1, len(samples) // MOST_COMPARED)]
    room = FOLLOWS * tolerance + part.tessellation_error
    off = float(distance_to_mesh(samples, part).max())
    if off > room:
        raise MoveError(f"the moved faces lie up to {off:.2g} mm off the adapted part, more than {room:.2g}")
    if abs(volume - part.volume) > VOLUME * part.volume + part.tessellation_error * part.area:
        raise MoveError(f"the volume of the moved solids differs by {volume / part.volume - 1:+.2%} from the part's")

"""By how much a cut has to be moved so that the exact damage volume is as large as the mesh.

A simplified surface is fitted to points by distances, of which those at edges and at the rim, where the mesh is
rounded, are one-sided. On shallow damages what is left of that is some tenths of a percent of the volume.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from damageest.artefacts import Part, Solid
from damageest.errors import InputError
from damageest.geometry.solids import to_manifold, unite
from damageest_cadquery.cutting.check_pieces import measure_inner_area
from damageest_cadquery.solids.face_measures import is_plane
from damageest_cadquery.solids.joining import explore_faces
from damageest_cadquery.solids.split import Piece, is_near, measure_volume, triangulate

OFF = 0.0015
"""Relative difference of the volumes from which the cut is moved: half of what the check allows."""
MOST = 1 / 8
"""Farthest that it is moved, in tolerances: half of what may lie between the surfaces."""
FINE = 1 / 64
"""Chord, in tolerances, of triangles that stand for CAD faces."""


class Balance:
    """The solids of the part and a damage volume of its mesh, in one unit and frame."""

    def __init__(self, solids: Sequence[Piece], part: Part, damage: Solid, tolerance: float) -> None:
        self.solids, self.part, self.damage, self.tolerance = solids, part, damage, tolerance
        self.origin = damage.bounds.mean(axis=0)

    def find_step(self, pieces: Sequence[Piece]) -> float:
        """How far a cut that gave these pieces has to be moved, out of the damage volume; 0 where it is well as it is,
        or where it would be moved too far."""
        area, off = measure_inner_area(pieces), self.measure_off(pieces)
        if area <= 0 or abs(off) <= OFF:
            return 0.0
        step = -off * self.damage.volume / area
        return 0.0 if abs(step) > MOST * self.tolerance else step

    def measure_off(self, pieces: Sequence[Piece]) -> float:
        """By what share of the mesh's volume the pieces are larger, beside what the chords of the part's triangles
        make; 0 where that is not known."""
        off = sum(measure_volume(piece.shape) for piece in pieces) - self.damage.volume
        curved = any(
            number >= 0 and not is_plane(face)
            for piece in pieces
            for face, (number, _) in zip(explore_faces(piece.shape), piece.origins, strict=True)
        )
        try:
            off -= self.measure_chords(pieces) if curved else 0.0
        except (InputError, ValueError):  # triangles that do not close
            return 0.0
        return float(off) / self.damage.volume

    def measure_chords(self, pieces: Sequence[Piece]) -> float:
        """How much larger the pieces are than the mesh because of the chords of the part's triangles alone."""
        exact = self._join([piece.shape for piece in pieces])
        meshed = to_manifold(self.part, self.origin)
        return float((exact - meshed).volume() - (to_manifold(self.damage, self.origin) - self._cad).volume())

    @cached_property
    def _cad(self) -> Any:
        return self._join([each.shape for each in self.solids if is_near(each.shape, self.damage)])

    def _join(self, shapes: Sequence[Any]) -> Any:
        return unite([triangulate(shape, FINE * self.tolerance) for shape in shapes], self.origin)

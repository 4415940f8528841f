"""What other folders of this package use of its functions on shapes. It imports OpenCASCADE."""

from __future__ import annotations

from damageest_cadquery.cutting.exact_damage import scale_shape
from damageest_cadquery.reading.colours import read_colours
from damageest_cadquery.reading.read import explore, read
from damageest_cadquery.reading.tessellate import measure_diagonal
from damageest_cadquery.solids.face_measures import measure_area
from damageest_cadquery.solids.joining import explore_faces
from damageest_cadquery.solids.split import is_near, measure_volume, triangulate
from damageest_cadquery.writing.assembly import NamedShape, write_assembly

__all__ = [
    "NamedShape", "explore", "explore_faces", "is_near", "measure_area", "measure_diagonal", "measure_volume", "read",
    "read_colours", "scale_shape", "triangulate", "write_assembly",
]  # fmt: skip

"""What other folders of this package use of its functions on shapes. It imports OpenCASCADE."""

from __future__ import annotations

from damageest_cadquery._assembly import NamedShape, write_assembly
from damageest_cadquery._check import measure_area
from damageest_cadquery._colours import read_colours
from damageest_cadquery._exact import scale_shape
from damageest_cadquery._read import explore, read
from damageest_cadquery._solids import explore_faces
from damageest_cadquery._split import is_near, measure_volume, triangulate
from damageest_cadquery._tessellate import measure_diagonal

__all__ = [
    "NamedShape", "explore", "explore_faces", "is_near", "measure_area", "measure_diagonal", "measure_volume", "read",
    "read_colours", "scale_shape", "triangulate", "write_assembly",
]  # fmt: skip

"""Kind and area of a face."""

from __future__ import annotations

from typing import Any


def is_plane(face: Any) -> bool:
    """Whether a face is flat by its kind."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_Plane

    return bool(BRepAdaptor_Surface(face).GetType() == GeomAbs_Plane)


def measure_area(face: Any, error: float | None = None) -> float:
    """The area of a face, within the relative ``error`` where one is given."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    sizes = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, sizes, *([] if error is None else [error]))
    return float(sizes.Mass())

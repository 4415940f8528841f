"""Tolerances that a CAD file claims for its edges and corners without need.

A file can claim a millimetre and more for an edge that lies on its faces within 1e-7. OpenCASCADE takes all that is
nearer than the claim for the edge itself, so it finds no cut there, or a wrong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

COARSE = 1e-3
LEVELS = (1e-5, 1e-4, 1e-3)
"""Claims that are tried, in millimetres; those that are smaller stay."""


def lower_claims(solid: Any, most: float) -> Any:
    """A solid of which an edge or a corner claims more than ``most``: a copy that claims as little as BRepCheck, which
    measures how far edges lie off their faces, still finds valid. Itself where none does, or where nothing lower is."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
    from OCP.ShapeFix import ShapeFix_ShapeTolerance
    from OCP.TopAbs import TopAbs_SHAPE

    largest = ShapeAnalysis_ShapeTolerance().Tolerance(solid, 1)
    if largest <= most or not BRepCheck_Analyzer(solid).IsValid():
        return solid
    for level in LEVELS:
        if level >= largest:
            break
        copy = BRepBuilderAPI_Copy(solid).Shape()
        ShapeFix_ShapeTolerance().LimitTolerance(copy, 0.0, level, TopAbs_SHAPE)
        if BRepCheck_Analyzer(copy).IsValid():
            return copy
    return solid


def find_coarse(solids: Sequence[Any], tolerance: float) -> tuple[float, ...]:
    """The fuzzy value to try last, in millimetres, where edges need what they claim: there the sections of two faces
    end apart. None where no edge claims as much, or a thousandth of the tolerance is less."""
    from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance

    claimed = max((ShapeAnalysis_ShapeTolerance().Tolerance(solid, 1) for solid in solids), default=0.0)
    return (COARSE,) if min(claimed, tolerance / 1000) >= COARSE else ()

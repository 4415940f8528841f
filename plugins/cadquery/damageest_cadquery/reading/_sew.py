"""Surfaces that a file holds in place of a solid: sewn together, over gaps up to a limit."""

from __future__ import annotations

from typing import Any

from damageest.errors import InputError
from damageest_cadquery.reading.read import explore, find_box

LEAST = 1e-3
"""Gap that is closed first, in OpenCASCADE's lengths: files in millimetres have three digits after the point."""
GROWTH = 2.0
MOST = 1e-3
"""Largest gap by default, in diagonals of the box round the surfaces."""


def sew(shape: Any, gap: float | None = None) -> tuple[list[Any], float]:
    """The solids that the faces of a shape bound, and the largest gap that was closed between them, 0 up to `LEAST`.

    The gap that is closed grows by steps until nothing is open, so that no more is closed than has to be. ``gap``: its
    limit, None: `MOST`. Raises InputError where edges stay open.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
    from OCP.ShapeFix import ShapeFix_Solid
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    faces = explore(shape, TopAbs_FACE)
    limit = MOST * float(find_box(faces).SquareExtent()) ** 0.5 if gap is None else gap
    width = min(LEAST, limit) if gap is not None else LEAST
    while True:
        sewing = BRepBuilderAPI_Sewing(width)
        for face in faces:
            sewing.Add(face)
        sewing.Perform()
        shells = [TopoDS.Shell_s(shell) for shell in explore(sewing.SewedShape(), TopAbs_SHELL)]
        loose = explore(sewing.SewedShape(), TopAbs_FACE)
        kept = sum(len(explore(shell, TopAbs_FACE)) for shell in shells)
        if shells and kept == len(loose) and all(BRep_Tool.IsClosed_s(shell) for shell in shells):
            break
        if width >= limit:
            raise InputError(
                f"holds surfaces only, no solid; sewn together over gaps of up to {width:.2g} they leave "
                f"{sewing.NbFreeEdges()} open edges; export the part as a solid, or set part.gap to close larger gaps"
            )
        width = min(GROWTH * width, limit)
    return [ShapeFix_Solid().SolidFromShell(shell) for shell in shells], 0.0 if width <= LEAST else width

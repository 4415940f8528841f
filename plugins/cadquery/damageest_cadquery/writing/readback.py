"""Reads a written STEP file back and compares it with the shape that it was to hold.

OpenCASCADE's writer leaves out a face that it cannot translate, and its reader one that it cannot make: a file that was
written without an error can hold an open shell. So each file is measured as another program would find it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.errors import InputError
from damageest_cadquery.reading.read import explore, read_shape
from damageest_cadquery.solids.face_measures import measure_area
from damageest_cadquery.solids.split import measure_volume, triangulate

SAME = 1e-3
"""Largest relative difference between a solid's volume, or a surface's area, in the file and before."""
CHORD = 5e-4
"""Of triangles that are compared, in cubic roots of a solid's volume."""
COMPLETE = "with all of its volume"
"""How a fault ends of a file that lacks nothing."""
INVALID = f"a solid in it is not valid (BRepCheck), {COMPLETE}"


def find_fault(path: Path, shape: Any, volumes: Sequence[float] = ()) -> str:
    """Why a file does not hold ``shape`` as it should; empty where it does.

    ``volumes``: of the solids in mm³, where they are known better than from the shape.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    try:
        found = read_shape(path)
    except InputError as error:
        return f"it cannot be read: {error}"
    solids, wanted = explore(found, TopAbs_SOLID), explore(shape, TopAbs_SOLID)
    if len(solids) != len(wanted):
        fault = f"it holds {len(solids)} solids for {len(wanted)}"
        whole = [sum(map(measure_quickly, each)) for each in (solids, wanted)]
        return fault if not solids or _compare(whole[:1], whole[1:], "volume") else f"{fault}, {COMPLETE}"
    shells = [shell for solid in solids for shell in explore(solid, TopAbs_SHELL)]
    if not all(BRep_Tool.IsClosed_s(TopoDS.Shell_s(shell)) for shell in shells):
        return "a solid in it is open"
    if not solids:
        areas = [[sum(map(measure_area, explore(each, TopAbs_FACE)))] for each in (found, shape)]
        fault = _compare(areas[0], areas[1], "area of the surface")
    elif volumes:
        fault = _compare_volumes(solids, [], volumes, measure_quickly)
    else:
        # over long splines the quick integrals are wrong, but by the same share where the faces are the same
        fault = _compare_volumes(solids, wanted, (), measure_quickly)
        fault = fault and _compare_volumes(solids, wanted, (), measure_volume)
        fault = fault and _compare_triangles(solids, wanted, fault)
    if fault:
        return fault
    return "" if BRepCheck_Analyzer(found).IsValid() else INVALID


def _compare_volumes(
    solids: Sequence[Any], wanted: Sequence[Any], volumes: Sequence[float], measure: Callable[[Any], float]
) -> str:
    before = list(volumes) or [measure(solid) for solid in wanted]
    return _compare(sorted(map(measure, solids)), sorted(before), "volume of a solid")


def _compare_triangles(solids: Sequence[Any], wanted: Sequence[Any], fault: str) -> str:
    """Compares the volumes of fine triangles: over walls on cones and splines, integrals can be wrong by a percent, in
    the file by another one than before. ``fault`` where the triangles do not close."""
    try:
        volumes = [
            sorted(triangulate(solid, CHORD * abs(measure_quickly(solid)) ** (1 / 3)).volume for solid in each)
            for each in (solids, wanted)
        ]
    except (InputError, ValueError):
        return fault
    return _compare(volumes[0], volumes[1], "volume of a solid")


def _compare(found: Sequence[float], wanted: Sequence[float], what: str) -> str:
    before = np.asarray(wanted)
    off = np.abs(np.asarray(found) - before) / np.maximum(np.abs(before), 1e-300)
    return "" if (off <= SAME).all() else f"the {what} in it differs by {off.max():.2%}"


def measure_quickly(solid: Any) -> float:
    """A volume by OpenCASCADE's fixed number of points."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    sizes = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, sizes)
    return float(sizes.Mass())

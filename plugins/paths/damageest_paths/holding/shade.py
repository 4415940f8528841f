"""Where on a layer along the floor a wall beside the bead stands in the beam of an upright tool."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.distance import distance_to_mesh
from damageest_paths.holding.follow import limit_tilt
from damageest_paths.process.process import Process
from damageest_paths.sheets.sheets import Sheet

HEIGHTS = (0.5, 1.0, 2.0)
"""Heights above the bead, in radii of the beam, at which walls are looked for; what is higher the tool leans from."""
OVER = 1.05
"""The least height, in radii of the beam, above what the layer lies on."""
ROOM = 1.02
"""Share of the beam's radius that has to be free round its middle: a scanned wall is rough."""


def measure_shade(sheet: Sheet, reach: Floats, metal: Mesh, height: float, process: Process) -> Floats | None:
    """By how much (N,) metal is too near to the middle of the beam, at points of a sheet, negative where it is not;
    None without a beam or metal, and with axes that do not follow the layer.

    ``reach`` (N,): as of `measure_reach`; points that are farther than a bead's width count as free. ``height``: of
    the layer.
    """
    if process.beam is None or process.axes != 5 or not len(metal.faces):
        return None
    radius = min(process.bead.width / 2, process.beam.radius)
    found = np.full(len(sheet.points), -radius)
    some = np.flatnonzero(sheet.is_found & (reach < process.bead.width))
    upright = limit_tilt(sheet.normals[some], process.tilt)
    least = np.full(len(some), np.inf)
    for share in HEIGHTS:
        up = max(share * radius, OVER * radius - height)
        least = np.minimum(least, distance_to_mesh(sheet.points[some] + up * upright, metal))
    found[some] = ROOM * radius - least
    return found

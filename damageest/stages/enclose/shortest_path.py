"""Rim to background by shortest paths, and the piece of background that they cut off."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Mesh, Part, Rims, Solid, Surface
from damageest.stages.enclose import Enclose


class ShortestPath(Enclose):
    """Maps each rim node to the nearest background vertex, joins the images by shortest paths, splits the background
    there and sews the damage's side to the rim (paper 3.1 steps 8 to 11). Which side that is, the sound points say."""

    use: Literal["shortest_path"] = "shortest_path"
    overhang: float = Field(
        3.0, ge=0, le=20, description="how far the rim is carried on along the surface, in tolerances"
    )

    def run(
        self, surface: Surface, rims: Rims, background: Solid, part: Part, intact: Floats, tolerance: float
    ) -> Mesh:
        """Raises StageError where paths do not close or lead through the part, or either side holds sound points, and
        NotSeparatedError where they do not split the background."""
        from scipy.spatial import cKDTree

        from damageest.stages.enclose._close import close_enclosure, orient_by_intact
        from damageest.stages.enclose._sew import extend_rims, trace_cycle

        surface, rims = orient_by_intact(surface, rims, intact)
        wide = extend_rims(surface, rims, self.overhang * tolerance)
        tree = cKDTree(background.vertices)
        images = [np.asarray(tree.query(wide.vertices[loop], workers=2)[1], np.int64) for loop in wide.loops]
        cycles = [trace_cycle(background.vertices, background.faces, image) for image in images]
        return close_enclosure(surface, wide, background, cycles, intact, part, tolerance)

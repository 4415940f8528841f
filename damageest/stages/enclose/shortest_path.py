"""Rims joined to the background by shortest paths."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Mesh, Part, Rims, Solid, Surface
from damageest.geometry.threads import count_threads
from damageest.stages.enclose import Enclose


class ShortestPath(Enclose):
    """Joins the rims to the background along shortest paths between nearest vertices (paper 3.1 steps 8 to 11).

    Each rim node is mapped to the nearest background vertex; shortest paths between these split the background. The
    side without intact points is joined to the rim. Needs a background that is fine everywhere; see also `adaptive`.
    """

    use: Literal["shortest_path"] = "shortest_path"
    overhang: float = Field(3.0, ge=0, le=20, description="extension of the surface beyond its rim, in tolerances")

    def run(
        self, surface: Surface, rims: Rims, background: Solid, part: Part, intact: Floats, tolerance: float
    ) -> Mesh:
        """Raises StageError where no path closes, where a strip runs through the part, or where the intact points do
        not show which side is lost; NotSeparatedError where the paths do not split the background."""
        from scipy.spatial import cKDTree

        from damageest.stages.enclose._close import close_enclosure, orient_by_intact
        from damageest.stages.enclose._sew import extend_rims, trace_closed_path

        surface, rims = orient_by_intact(surface, rims, intact)
        wide = extend_rims(surface, rims, self.overhang * tolerance)
        tree = cKDTree(background.vertices)
        images = [
            np.asarray(tree.query(wide.vertices[loop], workers=count_threads())[1], np.int64) for loop in wide.loops
        ]
        paths = [trace_closed_path(background.vertices, background.faces, image) for image in images]
        return close_enclosure(surface, wide, background, paths, intact, part, tolerance)

"""Rim to the nearest points of a background that is refined only there."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Mesh, Part, Rims, Solid, Surface
from damageest.stages.enclose import Enclose


class Adaptive(Enclose):
    """Maps each rim node to the nearest point of the background, which is refined along the rim and nowhere else, and
    joins them by shortest paths within what was refined (the paper's 5.1, future work): its cost grows with the rim's
    length, not with the part's surface."""

    refines: ClassVar[bool] = True

    use: Literal["adaptive"] = "adaptive"
    overhang: float = Field(
        3.0, ge=0, le=20, description="how far the rim is carried on along the surface, in tolerances"
    )
    edge: float = Field(
        1.5,
        gt=0,
        le=100,
        description="longest edge of the background along the rim, in tolerances; at least the spacing of its nodes",
    )

    def run(
        self, surface: Surface, rims: Rims, background: Solid, part: Part, intact: Floats, tolerance: float
    ) -> Mesh:
        """Raises StageError where paths do not close or lead through the part, or either side holds sound points, and
        NotSeparatedError where they do not split the background."""
        from scipy.spatial import cKDTree

        from damageest.stages.enclose._close import agreed, closed
        from damageest.stages.enclose._refine import inserted, nearest, refined_at
        from damageest.stages.enclose._sew import carried_on, cycle

        surface, rims = agreed(surface, rims, intact)
        wide = carried_on(surface, rims, self.overhang * tolerance)
        nodes = np.concatenate([wide.vertices[loop] for loop in wide.loops])
        steps = [np.linalg.norm(np.diff(wide.vertices[loop], axis=0), axis=1) for loop in wide.loops]
        edge = max(self.edge * tolerance, float(np.median(np.concatenate(steps))))
        face, foot = nearest(background, nodes)
        ends = np.cumsum([len(loop) for loop in wide.loops])
        more, way = nearest(background, np.concatenate([_between(one, edge) for one in np.split(foot, ends[:-1])]))
        mesh, held = refined_at(background, np.concatenate([face, more]), np.concatenate([foot, way]), edge)
        mesh, image = inserted(mesh, held[: len(foot)], foot)
        # Paths stay where the mesh is fine: what is nearest to the ways between the images was refined with them.
        trail = cKDTree(np.concatenate([foot, way]))
        close = np.isfinite(trail.query(mesh.vertices, distance_upper_bound=3 * edge, workers=2)[0])
        close[image] = True
        near = close[mesh.faces].any(axis=1)
        cycles = [cycle(mesh.vertices, mesh.faces[near], one) for one in np.split(image, ends[:-1])]
        return closed(surface, wide, mesh, cycles, intact, part, tolerance)


def _between(foot: Floats, edge: float) -> Floats:
    """Points (K,3) on the straight ways between the images of neighbouring nodes that lie more than an edge apart: what
    is nearest to them is where the path between the two will run."""
    after = np.roll(foot, -1, axis=0)
    count = np.minimum(np.linalg.norm(after - foot, axis=1) // edge, 1000).astype(np.int64)
    which = np.repeat(np.arange(len(foot)), count)
    place = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1) / (count[which] + 1)
    return np.asarray(foot[which] + place[:, None] * (after - foot)[which])

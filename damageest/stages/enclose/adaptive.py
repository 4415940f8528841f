"""Rim to the nearest points of a background that is refined only there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Solid, Surface
from damageest.errors import StageError
from damageest.stages.enclose import Enclose

if TYPE_CHECKING:
    from damageest.stages.enclose._sew import Cycle

ROUNDS = 12
MOST_BETWEEN = 1000
"""Points put between two images at a time."""


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
        from damageest.geometry.refinement import find_nearest, insert_points, refine_at
        from damageest.stages.enclose._close import close_enclosure, orient_by_intact
        from damageest.stages.enclose._sew import extend_rims

        surface, rims = orient_by_intact(surface, rims, intact)
        wide = extend_rims(surface, rims, self.overhang * tolerance)
        nodes = np.concatenate([wide.vertices[loop] for loop in wide.loops])
        steps = [np.linalg.norm(np.diff(wide.vertices[loop], axis=0), axis=1) for loop in wide.loops]
        edge = max(self.edge * tolerance, float(np.median(np.concatenate(steps))))
        face, foot = find_nearest(background, nodes)
        ends = np.cumsum([len(loop) for loop in wide.loops])[:-1]
        trails = [trace_trail(background, one, edge) for one in np.split(foot, ends)]
        more, way = find_nearest(background, np.concatenate(trails))
        mesh, held = refine_at(background, np.concatenate([face, more]), np.concatenate([foot, way]), edge)
        mesh, image = insert_points(mesh, held[: len(foot)], foot)
        near = _find_along(mesh, np.concatenate([foot, way]), 3 * edge) | np.isin(mesh.faces, image).any(axis=1)
        cycles = [_trace_cycle(mesh, near, one) for one in np.split(image, ends)]
        return close_enclosure(surface, wide, mesh, cycles, intact, part, tolerance)


def trace_trail(background: Mesh, foot: Floats, edge: float) -> Floats:
    """Points (K,3) on a background where the closed path through its points ``foot`` (N,3) will run, none farther than
    an edge from the next unless the background has no surface between them."""
    from damageest.geometry.refinement import find_nearest

    at = foot
    for _ in range(ROUNDS):
        after = np.roll(at, -1, axis=0)
        count = np.minimum(np.linalg.norm(after - at, axis=1) // edge, MOST_BETWEEN).astype(np.int64)
        if not count.any():
            break
        which = np.repeat(np.arange(len(at)), count)
        place = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1) / (count[which] + 1)
        # The straight way leaves the surface at an edge; what is nearest to it leaves a smaller gap each time.
        _, between = find_nearest(background, at[which] + place[:, None] * (after - at)[which])
        order = np.argsort(np.concatenate([np.arange(len(at)), which + place]), kind="stable")
        at = np.concatenate([at, between])[order]
    return at


def _find_along(mesh: Mesh, places: Floats, reach: float) -> NDArray[np.bool_]:
    """(F,) which faces have a corner within ``reach`` of places (K,3)."""
    from scipy.spatial import cKDTree

    far, _ = cKDTree(places).query(mesh.vertices, distance_upper_bound=reach, workers=2)
    return np.asarray(np.isfinite(far)[mesh.faces].any(axis=1))


def _trace_cycle(mesh: Mesh, near: NDArray[np.bool_], image: Ints) -> Cycle:
    """The cycle within the ``near`` faces, where the mesh is fine; on all of it where they do not hang together."""
    from damageest.stages.enclose._sew import trace_cycle

    try:
        return trace_cycle(mesh.vertices, mesh.faces[near], image)
    except StageError:
        return trace_cycle(mesh.vertices, mesh.faces, image)

"""Rims joined to the nearest points of a background that is refined only there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Solid, Surface
from damageest.errors import StageError
from damageest.geometry.threads import count_threads
from damageest.stages.enclose import Enclose

if TYPE_CHECKING:
    from damageest.stages.enclose._sew import ClosedPath

ROUNDS = 12
"""Passes of `trace_trail`; each leaves smaller gaps."""
MOST_BETWEEN = 1000
"""Points put between two neighbours in one pass."""


class Adaptive(Enclose):
    """Joins the rims to the background, which it refines only near them (paper 5.1, future work).

    Then like `shortest_path`, with paths on the refined faces. Its cost grows with the length of the rims, not with the
    surface of the part.
    """

    refines: ClassVar[bool] = True

    use: Literal["adaptive"] = "adaptive"
    overhang: float = Field(3.0, ge=0, le=20, description="extension of the surface beyond its rim, in tolerances")
    edge: float = Field(
        1.5,
        gt=0,
        le=100,
        description="longest edge of the background near the rim, in tolerances; at least the rim's node spacing",
    )

    def run(
        self, surface: Surface, rims: Rims, background: Solid, part: Part, intact: Floats, tolerance: float
    ) -> Mesh:
        """Raises StageError where no path closes, where a strip runs through the part, or where the intact points do
        not show which side is lost; NotSeparatedError where the paths do not split the background."""
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
        mesh, holding = refine_at(background, np.concatenate([face, more]), np.concatenate([foot, way]), edge)
        mesh, image = insert_points(mesh, holding[: len(foot)], foot)
        near = _find_along(mesh, np.concatenate([foot, way]), 3 * edge) | np.isin(mesh.faces, image).any(axis=1)
        paths = [_trace_path(mesh, near, one) for one in np.split(image, ends)]
        return close_enclosure(surface, wide, mesh, paths, intact, part, tolerance)


def trace_trail(background: Mesh, foot: Floats, edge: float) -> Floats:
    """Points (K,3) on the background along which the closed path through its points ``foot`` (N,3) will run.

    Neighbours are at most ``edge`` apart, except where the background has no surface between them.
    """
    from damageest.geometry.refinement import find_nearest

    at = foot
    for _ in range(ROUNDS):
        after = np.roll(at, -1, axis=0)
        count = np.minimum(np.linalg.norm(after - at, axis=1) // edge, MOST_BETWEEN).astype(np.int64)
        if not count.any():
            break
        which = np.repeat(np.arange(len(at)), count)
        place = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1) / (count[which] + 1)
        # A straight line between two points leaves the surface at its edges. The points nearest to the line lie on it,
        # and the gaps between them are smaller.
        _, between = find_nearest(background, at[which] + place[:, None] * (after - at)[which])
        order = np.argsort(np.concatenate([np.arange(len(at)), which + place]), kind="stable")
        at = np.concatenate([at, between])[order]
    return at


def _find_along(mesh: Mesh, places: Floats, reach: float) -> NDArray[np.bool_]:
    """(F,) whether a corner of each face is within ``reach`` of places (K,3)."""
    from scipy.spatial import cKDTree

    far, _ = cKDTree(places).query(mesh.vertices, distance_upper_bound=reach, workers=count_threads())
    return np.asarray(np.isfinite(far)[mesh.faces].any(axis=1))


def _trace_path(mesh: Mesh, near: NDArray[np.bool_], image: Ints) -> ClosedPath:
    """The closed path on the ``near`` faces (F,), where the mesh is fine; on all faces where it finds none there."""
    from damageest.stages.enclose._sew import trace_closed_path

    try:
        return trace_closed_path(mesh.vertices, mesh.faces[near], image)
    except StageError:
        return trace_closed_path(mesh.vertices, mesh.faces, image)

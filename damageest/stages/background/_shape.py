"""What the backgrounds made from a shape share: clearance, subdivision, the check that they hold the part."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Mesh, Part, Solid, Surface
from damageest.errors import StageError
from damageest.geometry.distance import is_inside
from damageest.geometry.refinement import halve_edges
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.stages.background import Background

MOST_FACES = 400_000
"""About how many triangles a background may have."""
PASSES = 6
"""Most passes of a subdivision."""
Subdivision = Literal["linear", "loop", "butterfly", "adaptive"]


class ShapeBackground(Background, ABC):
    """A shape round part and damage surface, subdivided where `enclose` needs it fine everywhere (paper 3.2)."""

    clearance: float = Field(
        2.0, gt=0, le=100, description="distance from the part, in tolerances; at least 1.5 point spacings"
    )
    edge: float = Field(
        3.0, gt=0, le=100, description="longest edge, in tolerances; longer where that would make too many triangles"
    )
    subdivide: Subdivision = Field(
        "linear",
        description="refinement to that edge: linear (edges into equal parts), adaptive (long edges halved), "
        "loop or butterfly (smoothing; not for shapes with sharp corners)",
    )

    def run(self, part: Part, surface: Surface, tolerance: float, spacing: float, fine: bool) -> Solid:
        """Raises StageError where the background does not hold part and damage surface."""
        check_surface(surface)
        gap = max(self.clearance * tolerance, 1.5 * spacing)
        origin = (part.bounds[0] + part.bounds[1]) / 2
        body = self.build_shape(part, surface, gap, origin)
        if fine:
            body = refine_body(body, self.edge * max(tolerance, 0.5 * spacing), self.subdivide)
        solid = to_solid(body, origin)
        if solid is None:
            raise StageError("the background is empty", "background: minkowski", method="implicit")
        return check_holds(solid, list_skin(part), surface)

    @abstractmethod
    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """A closed shape as a ``manifold3d.Manifold`` relative to ``origin`` (3,), at least ``gap`` from the part."""


def refine_body(body: Any, edge: float, how: Subdivision = "linear") -> Any:
    """A Manifold with no edge longer than ``edge``, or longer ones where that takes more than MOST_FACES faces."""
    least = float(np.sqrt(8 * body.surface_area() / np.sqrt(3) / MOST_FACES))
    edge = max(edge, least)
    if how == "linear":
        return _divide(body, edge)
    vertices, faces = to_arrays(body)
    if how == "adaptive":
        # VTK's own adaptive subdivision leaves cracks beside slender triangles.
        return to_manifold(halve_edges(Mesh(vertices, faces), edge))
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(vertices, faces)
    passes = int(np.ceil(np.log2(max(_measure_longest(vertices[faces]) / edge, 1))))
    passes = min(passes, int(np.log(max(MOST_FACES / len(faces), 1)) / np.log(4)))
    mesh = mesh.subdivide(passes, subfilter=how) if passes else mesh
    try:
        fine = to_manifold(Mesh(np.asarray(mesh.points), mesh.regular_faces))
    except ValueError as error:
        raise StageError(
            f"the background is no longer closed after subdivide: {how} ({error})", "subdivide: linear"
        ) from error
    # Loop and butterfly divide all triangles in four. Edges that are still too long are divided evenly.
    return _divide(fine, edge)


def _divide(body: Any, edge: float) -> Any:
    """A Manifold with its edges divided into equal parts. Several passes, for edges across slender triangles."""
    for _ in range(PASSES):
        vertices, faces = to_arrays(body)
        if _measure_longest(vertices[faces]) <= edge:
            break
        body = body.refine_to_length(edge)
    return body


def _measure_longest(corners: Floats) -> float:
    """The longest edge of triangles (F,3,3)."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def check_surface(surface: Surface) -> None:
    """Raises StageError for a damage surface without vertices."""
    if not len(surface.vertices):
        raise StageError("the damage surface is empty", "another reconstruct", method="implicit")


def list_skin(part: Part) -> Floats:
    """Points (N,3) on the part's skin: its vertices and the middles of its triangles."""
    return np.concatenate([part.vertices, part.triangles.mean(axis=1)])


def find_outside(background: Solid, skin: Floats, surface: Surface) -> Floats:
    """The ``skin`` points (N,3) and vertices of the damage surface that do not lie inside the background (M,3)."""
    inner = np.concatenate([skin, surface.vertices])
    return inner[~is_inside(inner, background)]


def check_holds(background: Solid, skin: Floats, surface: Surface) -> Solid:
    """Gives the background. Raises StageError unless the ``skin`` points (N,3) and the damage surface lie inside it."""
    if outside := len(find_outside(background, skin, surface)):
        count = len(skin) + len(surface.vertices)
        raise StageError(
            f"the background does not contain part and damage surface: {outside} of {count} points lie outside it",
            "subdivide: linear, background: minkowski",
            method="implicit",
        )
    return background

"""Booleans by PyMeshLab."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from damageest.artefacts import Floats, Ints, Part, Solid
from damageest.errors import StageError
from damageest.stages.boolean import Boolean


class PyMeshLabBoolean(Boolean):
    """Intersection with exact predicates, by PyMeshLab (libigl's, after Zhou et al. 2016), in double precision.

    Slower than `manifold`, and an independent check of it.
    """

    isolated: ClassVar[bool] = True
    use: Literal["pymeshlab"] = "pymeshlab"

    def run(self, solid: Solid, part: Part) -> Solid | None:
        """The part of ``solid`` inside ``part``. Raises StageError where PyMeshLab refuses the meshes, or where its
        result is not watertight."""
        from damageest_pymeshlab._system import check

        check()
        import pymeshlab

        origin = part.bounds.mean(axis=0)
        meshes = pymeshlab.MeshSet(verbose=False)
        for body in (part, solid):
            meshes.add_mesh(pymeshlab.Mesh(np.array(body.vertices - origin), np.array(body.faces, dtype=np.int32)))
        try:
            meshes.generate_boolean_intersection(first_mesh=0, second_mesh=1)
        except pymeshlab.PyMeshLabException as error:
            if "Vertex matrix is empty" in str(error):  # this means: nothing in common
                return None
            raise StageError(
                f"PyMeshLab could not intersect the meshes: {str(error).strip()}",
                "boolean: manifold, or repair: pymeshfix",
            ) from None
        result = meshes.current_mesh()
        if not result.face_number():
            return None
        vertices, faces = _sort_mesh(
            np.asarray(result.vertex_matrix(), np.float64), result.face_matrix().astype(np.int64)
        )
        try:
            return Solid(vertices + origin, faces)
        except ValueError as error:
            raise StageError(f"the result of PyMeshLab is not usable: {error}", "boolean: manifold") from None


def _sort_mesh(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The same mesh with vertices (V,3) and faces (F,3) sorted: PyMeshLab's order depends on its threads."""
    order = np.lexsort(vertices.T[::-1])
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    faces = place[faces]
    faces = np.take_along_axis(faces, (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    return vertices[order], faces[np.lexsort(faces.T[::-1])]

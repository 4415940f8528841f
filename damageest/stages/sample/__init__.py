"""Stage `sample`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Samples
from damageest.stages import Stage, asked_by_name


class Sample(Stage, ABC):
    """Samples the part: points on all of its skin, with normals (paper 3.1 step 1).

    It runs only where another implementation of the job takes its points, for example `segment: cloud_distance`. The
    default route takes points near the damage alone, made by the pipeline.

    Args of ``run``:
        part: the part as designed, in its own frame and the job's unit.
        tolerance: the job's tolerance. The points are to be about this far apart.

    Returns:
        N points exactly on the part's triangles, with the number of the triangle (N,), its unit normal (N,3) and
        ``kind`` (N,): 0 on a face, 1 on a sharp edge, 2 on a corner; there the normal bisects those of the faces.
        Each point of the skin is within ``spacing`` of a sample.

    Raises:
        InputError: where the part has no area.

    Example::

        from typing import Literal
        import numpy as np
        import trimesh
        from damageest.artefacts import Part, Samples
        from damageest.errors import InputError
        from damageest.stages.sample import Sample

        class TriangleCentres(Sample):
            "The centres of triangles, after these are divided until no edge is longer than the tolerance."
            use: Literal["triangle_centres"] = "triangle_centres"

            def run(self, part: Part, tolerance: float) -> Samples:
                if not part.area > 0:
                    raise InputError("the part's surface has no area; check the file it was read from")
                vertices, faces, parent = trimesh.remesh.subdivide_to_size(
                    part.vertices, part.faces, tolerance, max_iter=30, return_index=True
                )
                points, kind = vertices[faces].mean(axis=1), np.zeros(len(parent), np.uint8)
                return Samples(points, part.face_normals[parent], parent, kind, tolerance)
    """

    stage: ClassVar[str] = "sample"
    gives: ClassVar[str] = "samples"

    @asked_by_name
    @abstractmethod
    def run(self, part: Part, tolerance: float) -> Samples: ...

"""Stage `enclose`: its two contracts, site by site and all sites at once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Deviation, Enclosures, Floats, Mesh, Part, Rims, Samples, Scan, Sites, Solid, Surface
from damageest.errors import StageError
from damageest.stages import Stage, asked_by_name


class NotSeparatedError(StageError):
    """The rims of one inner damage surface do not split the background in two: the surface bounds lost metal only
    together with others."""


class Enclose(Stage, ABC):
    """Closes the inner damage surface (IDS) of one site to a mesh around its lost metal (paper 3.1 steps 8 to 11).

    ``refines``: set it to True where the implementation refines the background itself, or does not use it; `background`
    then makes a coarse one.

    Args of ``run``, lengths in the job's unit, coordinates in the part's frame:
        surface: the IDS, an open mesh; its normals point to the lost metal, but do not rely on it.
        rims: the loops of its boundary that lie near the part's skin.
        background: a closed mesh that holds the IDS and all the lost metal.
        part: the part as designed.
        intact: (K,3) scan points on the intact skin. They must stay outside.
        points: (M,3) the scan points of the site.
        tolerance: the IDS ends about this far below the part's skin.

    Returns:
        A mesh, faces outward. The metal of the part inside it is the damage; outside the part it may hold anything. It
        need not be watertight: `repair` follows.

    Raises:
        NotSeparatedError: where the IDS alone cuts nothing off the background. Such surfaces are then tried together:
            a piece broken out of a ring leaves two, one at each end.
        StageError: where there is no right enclosure for another reason.

    Example::

        from typing import Literal
        import numpy as np
        import trimesh
        from damageest.artefacts import Mesh, Rims, Surface
        from damageest.errors import StageError
        from damageest.stages.enclose import Enclose

        class Hull(Enclose):
            "The convex hull of a damage surface, raised at its rim; for round dents in a flat skin."
            use: Literal["hull"] = "hull"

            def run(self, surface: Surface, rims: Rims, tolerance: float) -> Mesh:
                if len(rims.loops) != 1:
                    raise StageError(f"the damage surface has {len(rims.loops)} rims, not one", "enclose: divide")
                rim = surface.vertices[rims.loops[0]]
                out = rim.mean(axis=0) - surface.vertices.mean(axis=0)
                raised = rim + 2 * tolerance * out / np.linalg.norm(out)
                hull = trimesh.PointCloud(np.concatenate([surface.vertices, raised])).convex_hull
                return Mesh(hull.vertices, hull.faces)
    """

    refines: ClassVar[bool] = False

    stage: ClassVar[str] = "enclose"
    gives: ClassVar[str] = "enclosure"
    per_site: ClassVar[bool] = True

    @asked_by_name
    @abstractmethod
    def run(
        self,
        surface: Surface,
        rims: Rims,
        background: Solid,
        part: Part,
        intact: Floats,
        points: Floats,
        tolerance: float,
    ) -> Mesh: ...


class EncloseAll(Stage, ABC):
    """Encloses the lost metal of all sites at once, for routes that do not go site by site.

    ``method``: the value of the job's `method` that chooses the implementation. A plugin may add a method of its own;
    job files can then use it.

    Args of ``run``, lengths in the job's unit, coordinates in the part's frame:
        part: the part as designed.
        aligned: the scan, N points.
        deviation: for each scan point its signed distance to the part (positive outside), the nearest triangle of the
            part, and its label.
        sites: for each scan point the number of its site, from 1; 0 for a point of no site.
        samples: points on all of the part's skin, with normals; made only for an implementation that takes them.
        nearby: points on the faces of the skin round the damage, with normals, about a tolerance apart near damaged
            points and where the scan shows no skin, two elsewhere: in cubes with damaged points, those connected to
            them with few points of the scan, and those round both. The cubes have an edge of `nearby_reach` tolerances,
            up to 40 in a sparse scan. Cheaper than ``samples`` on a part of many triangles.
        tolerance: depth from which a point counts as damage.

    Returns:
        Enclosures that do not overlap; each names its sites, and each site is in one of them. Inside the part an
        enclosure holds lost metal only; outside the part it may hold anything.

    Raises:
        StageError: where no site can be enclosed.

    Example::

        from typing import ClassVar, Literal
        import numpy as np
        from trimesh.creation import box
        from damageest.artefacts import Enclosure, Enclosures, Part, Scan, Sites, Solid
        from damageest.stages.enclose import EncloseAll

        class WornTop(EncloseAll):
            "The part above a level plane; for parts that are worn evenly from the top."
            method: ClassVar[str] = "worn_top"
            use: Literal["worn_top"] = "worn_top"

            def run(self, part: Part, aligned: Scan, sites: Sites, tolerance: float) -> Enclosures:
                if not sites.count:
                    return Enclosures(())
                low, high = part.bounds[0] - tolerance, part.bounds[1] + tolerance
                low[2] = np.median(aligned.points[sites.label > 0, 2])
                top = box(bounds=[low, high])
                return Enclosures((Enclosure(Solid(top.vertices, top.faces), tuple(range(1, sites.count + 1))),))
    """

    method: ClassVar[str] = "implicit"

    stage: ClassVar[str] = "enclose"
    gives: ClassVar[str] = "enclosures"

    @property
    def nearby_reach(self) -> float:
        """How far beyond the damaged points ``nearby`` has to reach, in tolerances; it always reaches 20."""
        return 20.0

    @asked_by_name
    @abstractmethod
    def run(
        self,
        part: Part,
        aligned: Scan,
        deviation: Deviation,
        sites: Sites,
        samples: Samples,
        nearby: Samples,
        tolerance: float,
    ) -> Enclosures: ...

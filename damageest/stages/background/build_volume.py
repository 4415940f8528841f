"""A part of the printer's build volume as background."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat

from damageest.artefacts import Floats, Part, Samples, Solid, Surface, Vector
from damageest.errors import StageError
from damageest.geometry.threads import count_threads
from damageest.stages.background import Background


class BuildVolume(Background):
    """A grid over the printer's build volume, the same for every part (paper 3.2).

    It makes only the cells around the site; the background is the surface at the clearance from the part, cut to these
    cells. For shops that repair many kinds of parts in one machine: set it up once; parts larger than the machine are
    refused.
    """

    use: Literal["build_volume"] = "build_volume"
    size: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = Field(
        description="size of the build volume along x, y, z, in the job's unit"
    )
    corner: Vector | None = Field(
        None,
        description="lowest corner of the build volume in the part's frame, in the job's unit; default: the volume is "
        "centred on the origin",
    )
    cell: float | None = Field(
        None,
        gt=0,
        description="edge of the grid's cells, in the job's unit: the finest detail that the machine can deposit; "
        "default: the clearance",
    )
    clearance: float = Field(
        2.0, gt=0, le=100, description="distance from the part, in tolerances; at least 1.5 point spacings"
    )
    margin: float = Field(
        12.0,
        ge=6,
        le=1000,
        description="reach of the cells around the site, in tolerances or point spacings, whichever is larger",
    )

    def run(
        self, part: Part, surface: Surface, samples: Samples, intact: Floats, tolerance: float, spacing: float
    ) -> Solid:
        """Raises StageError where the part does not fit in, or the cells round the site do not fit into memory."""
        from damageest.geometry.contour import extract_contour
        from damageest.geometry.distance import signed_distance
        from damageest.stages.background._shape import check_holds, check_surface

        check_surface(surface)
        clearance = max(self.clearance * tolerance, 1.5 * spacing)
        cell = self.cell or clearance
        size = np.array(self.size)
        corner = -size / 2 if self.corner is None else np.array(self.corner)
        over = np.maximum(
            corner + clearance + cell - part.bounds[0], part.bounds[1] - (corner + size - clearance - cell)
        )
        if (over > 0).any():
            text = ", ".join(f"{amount:.3g} in {name}" for name, amount in zip("xyz", over, strict=True) if amount > 0)
            raise StageError(
                f"the part with its clearance does not fit into the build volume: it sticks out by {text}",
                "another background.corner or background.size, in the part's frame",
            )
        reach = self.margin * max(tolerance, spacing)
        low, high = _find_neighbourhood(surface, samples, intact, max(3 * tolerance, 3 * spacing), samples.spacing)
        limit = np.round(size / cell).astype(np.int64)
        first = np.clip(np.floor((low - reach - corner) / cell).astype(np.int64), 0, limit)
        last = np.clip(np.ceil((high + reach - corner) / cell).astype(np.int64), 0, limit)
        nx, ny, nz = (int(n) for n in last - first + 1)

        def measure_gap(points: Floats) -> Floats:
            return signed_distance(points, part)[0] - max(clearance, 0.6 * cell) - 0.1 * cell

        solid = extract_contour(measure_gap, corner + cell * first, (nx, ny, nz), cell)
        inside = ((part.vertices > low) & (part.vertices < high)).all(axis=1)
        return check_holds(solid, part.vertices[inside], surface)


def _find_neighbourhood(
    surface: Surface, samples: Samples, intact: Floats, reach: float, gap: float
) -> tuple[Floats, Floats]:
    """Lowest and highest corner (3,) of the damage surface and of the skin that is lost with it.

    Skin is lost where it is connected to the rim and has no intact point within ``reach``. ``gap``: spacing of the
    samples.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    bare = samples.points
    if len(intact):
        bare = bare[~np.isfinite(cKDTree(intact).query(bare, distance_upper_bound=reach, workers=count_threads())[0])]
    places = [surface.vertices]
    if len(bare):
        tree = cKDTree(bare)
        pairs = tree.query_pairs(2 * gap, output_type="ndarray")
        links = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(bare),) * 2)
        label = connected_components(links, directed=False)[1]
        near, _ = cKDTree(surface.vertices).query(bare, distance_upper_bound=2 * reach, workers=count_threads())
        places.append(bare[np.isin(label, label[np.isfinite(near)])])
    points = np.concatenate(places)
    return points.min(axis=0), points.max(axis=0)

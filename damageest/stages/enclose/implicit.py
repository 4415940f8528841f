"""One closed surface by Poisson reconstruction: through all inner damage surfaces, and outside the intact skin."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Deviation, Enclosure, Enclosures, Floats, Part, Samples, Scan, Sites
from damageest.errors import StageError
from damageest.geometry.scan_field import ScanField
from damageest.geometry.voxels import measure_bounds
from damageest.stages.enclose import EncloseAll

if TYPE_CHECKING:
    from damageest.geometry.poisson import Grid


class Implicit(EncloseAll):
    """A closed screened Poisson surface around each loss, solved in its neighbourhood only.

    For damage of any shape: several losses, worn-through walls, broken-off ends. It needs no rims and no background.
    """

    renamed: ClassVar[Mapping[str, str]] = {"band": "rim_width", "push": "offset", "screening": "point_weight"}
    use: Literal["implicit"] = "implicit"
    cell: float = Field(1.0, gt=0.1, le=4, description="edge of a grid cell, in tolerances")
    rim_width: float = Field(
        1.0,
        ge=0,
        le=10,
        description="width of skin around the damaged points that does not constrain the surface, in tolerances",
    )
    offset: float = Field(1.0, gt=0, le=4, description="outward offset of the intact skin, in tolerances")
    margin: float = Field(
        8.0, ge=4, le=60, description="margin around a loss in which the surface is solved, in tolerances"
    )
    point_weight: float = Field(
        1.0, gt=0, le=100, description="weight of the points against the smoothness of the surface"
    )
    detail: float = Field(
        0.03,
        ge=0,
        le=1,
        description="largest movement of the surface by merging triangles, about, in tolerances; 0: no merging",
    )
    most_cells: int = Field(
        4_000_000, ge=50_000, le=60_000_000, description="most grid cells for one loss; a larger loss gets larger cells"
    )

    def run(
        self, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, nearby: Samples, tolerance: float
    ) -> Enclosures:
        """Raises StageError where no closed surface can be reconstructed."""
        from damageest.geometry.isosurface import extract_region
        from damageest.geometry.poisson import solve_coarse_to_fine
        from damageest.stages.enclose._gather import cut_beyond_reach, push_intact, select_in_grid, sort_losses
        from damageest.stages.enclose._refit import refit_region, thin_region

        if not sites.count:
            return Enclosures(())
        scanned = ScanField(part, aligned, deviation, tolerance)
        groups, skin = sort_losses(scanned, sites, nearby, self.rim_width)
        grids = [self._make_grid(np.concatenate([group.points, group.lost]), tolerance) for group in groups]
        gathered = push_intact(part, groups, skin, grids, self.offset * tolerance)
        items = []
        for number, (group, grid) in enumerate(zip(groups, grids, strict=True)):
            notes: tuple[str, ...] = ()
            if grid.cell > 2 * self.cell * tolerance:
                notes = (
                    f"large loss: solved in cells of {grid.cell:.3g} ({grid.cell / tolerance:.1f} tolerances); raise "
                    "enclose.most_cells for smaller ones",
                )
            points, normals, areas = select_in_grid(gathered, grid)
            field = solve_coarse_to_fine(grid, points, normals, areas, self.point_weight)
            field = cut_beyond_reach(grid, field, gathered, number, 4 * tolerance)
            region = extract_region(grid, field)
            if region is not None:
                region = refit_region(region, points, normals, 0.5 * tolerance)
                region = thin_region(region, self.detail * tolerance)
                items.append(Enclosure(region, group.sites, notes))
        if not items:
            raise StageError(
                "no closed surface could be reconstructed round the damage", "a larger tolerance", method="surface"
            )
        return Enclosures(tuple(items))

    @property
    def nearby_reach(self) -> float:
        """The samples have to hold the surface in all of the grid round a loss."""
        return max(super().nearby_reach, self.margin)

    def _make_grid(self, points: Floats, tolerance: float) -> Grid:
        """A grid round the points (N,3) of a loss."""
        from damageest.geometry.poisson import make_grid

        low, high = measure_bounds(points) + self.margin * tolerance * np.array([[-1.0], [1.0]])
        cell = max(self.cell * tolerance, float((np.prod(high - low) / self.most_cells) ** (1 / 3)))
        return make_grid(low, high, cell)

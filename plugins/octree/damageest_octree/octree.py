"""Octree of the part, octree of the damaged part, their difference: the damage as cells."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from damageest.artefacts import Deviation, Enclosure, Enclosures, Part, Samples, Scan, Sites
from damageest.errors import StageError
from damageest.stages.enclose import EncloseAll
from damageest_octree.sides import LEAK, Cube, Sides, divided

MARGIN = 8
"""Cells of void on each side of the part: a closing of three cells, and the way round it for the flood."""
LEAVES_PER_CELL_AREA = 3.0
"""Finest nodes for each cell's area of skin, siblings included (2.3 to 2.9 measured)."""
GIB = 2**30
BYTES_PER_LEAF, BYTES_PER_CELL = 600, 80
"""At the peak; 440 to 590 measured for a leaf of the octree, 73 for a cell of the grid round a loss."""
REACHES = (0, 1, 2, 3)
FINEST = 1 / 3
"""Of the points' spacing: seven cells, the widest closing, then bridge little more than twice the spacing, and gaps
between random points are wider."""
UNSEEN = 1e-3
"""Share of the skin without points that is worth a note."""


class Octree(EncloseAll):
    """Octree difference of part and scan, after DUOADD (Perini et al.; paper, section 4.1). For comparison, and where
    a volume to within a cell's depth will do. Cells on surfaces, and so memory, grow fourfold with each level."""

    method: ClassVar[str] = "octree"

    use: Literal["octree"] = "octree"
    depth: int | None = Field(
        None, ge=5, le=16, description="levels over the cube round the part; default: from the cell"
    )
    cell: float | None = Field(
        None, gt=0, description="edge of a finest cell, in the job's unit; default: the tolerance, or the spacing of "
        "the scan's points where that is larger, or what fits into the memory"
    )  # fmt: skip
    memory: float = Field(
        2.0, ge=0.01, le=64, description="GiB that the octree, and after it the grid round each loss, may take"
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> Octree:
        if self.depth is not None and self.cell is not None:
            raise ValueError("depth and cell say the same thing; give one of them")
        return self

    def run(
        self, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, samples: Samples, tolerance: float
    ) -> Enclosures:
        """Raises StageError where the cells would not fit into memory, are finer than the scan, or none is gone."""
        from damageest_octree.solid import box_cells, closed, losses

        if not sites.count:
            return Enclosures(())
        cube, notes = self._cube(part, aligned, tolerance)
        sides = _divided(cube, part, aligned, deviation, sites)
        if sides.reach:
            notes += (f"the points' shell was closed over {2 * sides.reach} cells of {cube.cell:.3g}",)
        if sides.unseen > UNSEEN:
            notes += (f"{sides.unseen:.1%} of the part's skin bears no points and was taken for sound",)
        found = losses(cube, sides, aligned, sites)
        largest = max((box_cells(sides, nodes) for nodes, _ in found), default=0)
        if largest * BYTES_PER_CELL > self.memory * GIB:
            fits = 1.1 * cube.cell * (largest * BYTES_PER_CELL / GIB / self.memory) ** (1 / 3)
            raise StageError(
                f"the box round a loss takes {largest:,} cells of {cube.cell:.3g}, "
                f"{largest * BYTES_PER_CELL / GIB:.1f} GiB; memory is {self.memory:g}",
                f"enclose.cell: {fits:.3g}, or more enclose.memory",
            )
        solids = [(closed(cube, sides, nodes), members) for nodes, members in found]
        items = [Enclosure(solid, members, notes) for solid, members in solids if solid is not None]
        if not items:
            raise StageError(
                f"no cell of {cube.cell:.3g} of the part is gone: the losses are shallower than the cells",
                "method: implicit, or a smaller enclose.cell",
            )
        # A site of no enclosure goes with the first one, where it bounds no piece and so becomes a failure of its own.
        left = set(range(1, sites.count + 1)) - {site for item in items for site in item.sites}
        items[0] = Enclosure(items[0].solid, (*items[0].sites, *sorted(left)), items[0].notes)
        return Enclosures(tuple(items))

    def _cube(self, part: Part, aligned: Scan, tolerance: float) -> tuple[Cube, tuple[str, ...]]:
        span = float(np.ptp(part.bounds, axis=0).max())
        if self.depth is not None:
            wanted = span / (2**self.depth - 2 * MARGIN)
        else:
            wanted = self.cell or max(tolerance, aligned.spacing)
        if wanted < FINEST * aligned.spacing:
            raise StageError(
                f"cells of {wanted:.3g} are too fine for points {aligned.spacing:.3g} apart: holes would be left",
                f"{_options(span, aligned.spacing)}, or a denser scan",
            )
        per_leaf = LEAVES_PER_CELL_AREA * part.area * BYTES_PER_LEAF / GIB
        fits = max(float(np.sqrt(per_leaf / self.memory)), span / (2**20 - 2 * MARGIN))
        if wanted >= fits:
            return _around(part, wanted), ()
        if self.cell or self.depth:
            raise StageError(
                f"cells of {wanted:.3g} take {per_leaf / wanted**2:.2g} GiB; memory is {self.memory:g}",
                f"{_options(span, max(fits, aligned.spacing))}, or more enclose.memory",
            )
        return _around(part, fits), (f"cells of {fits:.3g} instead of {wanted:.3g}, so as to fit into memory",)


def _divided(cube: Cube, part: Part, aligned: Scan, deviation: Deviation, sites: Sites) -> Sides:
    """With the least closing that keeps the flood out of the sound part."""
    from damageest_octree.tree import touched

    skin = touched((part.triangles - cube.origin) / cube.cell, cube.depth)
    leak = 0.0
    for reach in REACHES:
        sides = divided(cube, skin, part, aligned, deviation, sites, reach)
        leak = sides.leak
        if leak <= LEAK:
            return sides
    raise StageError(
        f"cells of {cube.cell:.3g} leave holes between points {aligned.spacing:.3g} apart: outside leaks into "
        f"{leak:.0%} of the sound part, even closed over {2 * REACHES[-1]} cells",
        f"enclose.cell: {max(1.5 * cube.cell, 1.01 * aligned.spacing):.3g}, or a denser scan",
    )


def _options(span: float, cell: float) -> str:
    """Values of both options that make cells of at least this size."""
    levels = int(np.log2(span / cell + 2 * MARGIN))
    return f"enclose.cell: {1.01 * cell:.3g}" + (f", enclose.depth: {levels}" if levels > 4 else "")


def _around(part: Part, cell: float) -> Cube:
    """The cube round the part, with MARGIN cells on each side; its depth follows."""
    span = float(np.ptp(part.bounds, axis=0).max())
    depth = int(np.ceil(np.log2(span / cell + 2 * MARGIN - 1e-9)))
    origin = part.bounds.mean(axis=0) - cell * 2**depth / 2
    # Cells in step with a plane of the part would let rounding choose its side.
    return Cube(origin + cell * np.array([0.317, 0.413, 0.271]), cell, depth)

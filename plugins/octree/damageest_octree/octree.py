"""The octree of the part minus the octree of the damaged part: the damage in cells."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from damageest.artefacts import Deviation, Enclosure, Enclosures, Part, Scan, Sites
from damageest.errors import StageError
from damageest.isolation import require_memory
from damageest.stages.enclose import EncloseAll
from damageest_octree.classify import LEAK, Cube, NodeFlags, classify_nodes

MARGIN = 8
"""Empty cells on each side of the part: room for a closing of three cells and for the flood round it."""
LEAVES_PER_CELL_AREA = 3.0
"""Finest nodes per cell area of skin, siblings included (2.3 to 2.9 measured)."""
GIB = 2**30
BYTES_PER_LEAF, BYTES_PER_CELL, BYTES_PER_POINT = 600, 80, 230
"""Largest memory use; measured: 440 to 590 for a leaf of the octree, 73 for a cell of the grid round a loss."""
REACHES = (0, 1, 2, 3)
"""Cells by which the shell of damaged points is thickened, in the order in which they are tried."""
GROWN, GROWTH = 3, 1.5
"""How often the cells are made larger where the job does not say how large they are, and by how much."""
FINEST = 1 / 3
"""Smallest cell, in point spacings: the widest closing, seven cells, then bridges about twice the spacing. Gaps between
random points are not always smaller."""
NOTED_UNSEEN = 1e-3
"""Share of the skin without points above which a note says so."""


class Octree(EncloseAll):
    """Octree of the part minus octree of the damaged part, after DUOADD (Perini et al.; paper, section 4.1).

    For comparison with other methods. The damage volume is right to about the depth of one cell. Each further level
    takes four times the memory.
    """

    method: ClassVar[str] = "octree"

    use: Literal["octree"] = "octree"
    depth: int | None = Field(
        None,
        ge=5,
        le=16,
        description="levels of the octree over the cube around the part; default: the number that `cell` needs",
    )
    cell: float | None = Field(
        None, gt=0, description="edge of the finest cells, in the job's unit; default: the larger of tolerance and "
        "point spacing, or more where these would not fit into `memory`"
    )  # fmt: skip
    memory: float = Field(
        2.0, ge=0.01, le=64, description="GiB that the octree may take, and after it the grid round each loss"
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> Octree:
        if self.depth is not None and self.cell is not None:
            raise ValueError("depth and cell both set the size of the cells; give one of them")
        return self

    def run(self, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, tolerance: float) -> Enclosures:
        """Raises StageError where the cells do not fit into memory, are too fine for the scan, or none is lost."""
        from damageest_octree.solid import close_loss, count_box_cells, find_losses

        if not sites.count:
            return Enclosures(())
        cube, notes = self._choose_cube(part, aligned, tolerance)
        deepest = -float(deviation.distance[sites.label > 0].min())
        if deepest < cube.cell:
            raise StageError(
                f"no damage is as deep as a cell of {cube.cell:.3g}: the deepest is {deepest:.3g}",
                f"enclose.cell: {0.5 * deepest:.2g}, where the points are nearer than that",
                method="implicit",
            )
        cube, flags, more = self._classify(cube, part, aligned, deviation, sites)
        notes += more
        if flags.reach:
            gap = f"gaps between the scan points were closed up to {2 * flags.reach} cells of {cube.cell:.3g}"
            notes += (f"{gap}; a denser scan needs less",)
        if flags.unseen > NOTED_UNSEEN:
            notes += (f"{flags.unseen:.1%} of the part's skin has no scan points and counts as intact; scan it",)
        losses = find_losses(cube, flags, aligned, sites)
        largest = max((count_box_cells(flags, nodes) for nodes, _ in losses), default=0)
        if largest * BYTES_PER_CELL > self.memory * GIB:
            fits = 1.1 * cube.cell * (largest * BYTES_PER_CELL / GIB / self.memory) ** (1 / 3)
            raise StageError(
                f"the grid round a loss needs {largest:,} cells of {cube.cell:.3g}, "
                f"{largest * BYTES_PER_CELL / GIB:.1f} GiB; enclose.memory is {self.memory:g}",
                f"enclose.cell: {fits:.3g}, or a larger enclose.memory",
            )
        remedy = "a larger enclose.cell, or more memory (--memory)"
        require_memory(BYTES_PER_CELL * largest, f"the grid of {largest:,} cells round a loss", remedy)
        solids = [(close_loss(cube, flags, nodes), members) for nodes, members in losses]
        items = [Enclosure(solid, members, notes) for solid, members in solids if solid is not None]
        if not items:
            raise StageError(
                f"no cell of {cube.cell:.3g} is lost: the damage is shallower than the cells",
                "a smaller enclose.cell",
                method="implicit",
            )
        # A site without an enclosure is named with the first one. No piece there touches its points, so that it is
        # reported as failed.
        missing = set(range(1, sites.count + 1)) - {site for item in items for site in item.sites}
        items[0] = Enclosure(items[0].solid, (*items[0].sites, *sorted(missing)), items[0].notes)
        return Enclosures(tuple(items))

    def _choose_cube(self, part: Part, aligned: Scan, tolerance: float) -> tuple[Cube, tuple[str, ...]]:
        span = float(np.ptp(part.bounds, axis=0).max())
        if self.depth is not None:
            wanted = span / (2**self.depth - 2 * MARGIN)
        else:
            wanted = self.cell or max(tolerance, aligned.spacing)
        if wanted < FINEST * aligned.spacing:
            raise StageError(
                f"cells of {wanted:.3g} are too fine for points {aligned.spacing:.3g} apart: holes would stay open",
                f"{_suggest_options(span, aligned.spacing)}, or a denser scan",
            )
        per_leaf = LEAVES_PER_CELL_AREA * part.area * BYTES_PER_LEAF / GIB
        fits = max(float(np.sqrt(per_leaf / self.memory)), span / (2**20 - 2 * MARGIN))
        require_memory(
            per_leaf / max(wanted, fits) ** 2 * GIB + BYTES_PER_POINT * len(aligned.points),
            f"an octree with cells of {max(wanted, fits):.3g}",
            "a smaller enclose.memory, which makes larger cells; a larger tolerance; or more memory (--memory)",
        )
        if wanted >= fits:
            return _make_cube(part, wanted), ()
        if self.cell or self.depth:
            raise StageError(
                f"cells of {wanted:.3g} need {per_leaf / wanted**2:.2g} GiB; enclose.memory is {self.memory:g}",
                f"{_suggest_options(span, max(fits, aligned.spacing))}, or a larger enclose.memory",
            )
        note = f"cells of {fits:.3g} instead of {wanted:.3g}, to fit into enclose.memory; raise it for finer ones"
        return _make_cube(part, fits), (note,)

    def _classify(
        self, cube: Cube, part: Part, aligned: Scan, deviation: Deviation, sites: Sites
    ) -> tuple[Cube, NodeFlags, tuple[str, ...]]:
        """The flags of the cube's cells; where the job does not say how large these are, larger ones are tried before
        the scan is refused."""
        start = cube.cell
        for more in range(GROWN if self.cell is None and self.depth is None else 0, -1, -1):
            try:
                flags = _classify_without_leak(cube, part, aligned, deviation, sites)
            except StageError:
                if not more:
                    raise
                cube = _make_cube(part, GROWTH * cube.cell)
            else:
                break
        note = (
            f"cells of {cube.cell:.3g}: finer ones, of {start:.3g}, leave holes between the points; scan more densely"
        )
        return cube, flags, (note,) if cube.cell > start else ()


def _classify_without_leak(cube: Cube, part: Part, aligned: Scan, deviation: Deviation, sites: Sites) -> NodeFlags:
    """The flags with the smallest closing that keeps the flood out of the intact part. Raises StageError where even the
    largest does not."""
    from damageest_octree.tree import find_touched_cells

    skin = find_touched_cells((part.triangles - cube.origin) / cube.cell, cube.depth)
    leak = 0.0
    for reach in REACHES:
        flags = classify_nodes(cube, skin, part, aligned, deviation, sites, reach)
        leak = flags.leak
        if leak <= LEAK:
            return flags
    raise StageError(
        f"cells of {cube.cell:.3g} leave holes between points {aligned.spacing:.3g} apart: {leak:.0%} of the intact "
        f"part counts as outside, even with gaps closed up to {2 * REACHES[-1]} cells",
        f"enclose.cell: {max(1.5 * cube.cell, 1.01 * aligned.spacing):.3g}, or a denser scan",
    )


def _suggest_options(span: float, cell: float) -> str:
    """A remedy: values of both options that make cells of at least this size."""
    levels = int(np.log2(span / cell + 2 * MARGIN))
    return f"enclose.cell: {1.01 * cell:.3g}" + (f", enclose.depth: {levels}" if levels > 4 else "")


def _make_cube(part: Part, cell: float) -> Cube:
    """The cube round the part with cells of this edge, and MARGIN cells on each side of the part."""
    span = float(np.ptp(part.bounds, axis=0).max())
    depth = int(np.ceil(np.log2(span / cell + 2 * MARGIN - 1e-9)))
    origin = part.bounds.mean(axis=0) - cell * 2**depth / 2
    # Shifted: where cell faces lie in a plane of the part, rounding would choose the side.
    return Cube(origin + cell * np.array([0.317, 0.413, 0.271]), cell, depth)

"""What result.json says of a site's deposition path."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import Vector
from damageest.output.base import Bound, JsonModel, strip_frame
from damageest.result import Site
from damageest.stages.export import ExportedFiles


class UnreachedReport(JsonModel):
    volume: float
    why: str


class BeadFillReport(JsonModel):
    """The union of the beads against the deposit, on voxels. Heat, flow and shrinkage are not simulated."""

    voxel: float = Field(description="edge of the voxels")
    filled: float = Field(description="share of the reachable deposit that beads fill")
    gap: float = Field(description="volume of the reachable deposit without beads")
    largest_gap: float = Field(description="volume of its largest connected piece")
    void: float = Field(description="diameter of the largest ball in it")
    spill: float = Field(description="volume of beads outside the deposit and the metal")
    spill_distance: float = Field(description="largest distance of beads from deposit and metal")
    sunk: float = Field(description="volume of beads where metal is already")
    of_deposit: float = Field(
        description="share of the whole deposit that beads fill: 1 without the shares of `unreachable_volume` and "
        "`gap`, as far as the voxels resolve it"
    )
    air: float = Field(description="height of the air between metal and the beads that lie on it, median")
    air_95: float = Field(description="the height that 95 % of their length does not exceed")


class PathReport(JsonModel):
    """The passes that build up the deposit. Times are those of the feeds, without acceleration."""

    passes: int
    layers: int
    layer_form: str = Field(
        description="planar: planes across the build direction; conformal: surfaces along the floor of the cavity; "
        "empty: not known"
    )
    directions: list[Vector] = Field(description="build direction of each part of the deposit")
    layer_heights: list[float] = Field(description="height of the layers in each part of the deposit")
    length: float = Field(description="length of all passes")
    travel: float = Field(description="length of the moves between them")
    minutes: float
    wait_minutes: float = Field(
        description="minutes of these in which the tool waits for neighbouring beads to cool down"
    )
    bead_volume: float = Field(description="volume that the passes add: length by section, that of the beads as laid")
    deposit_volume: float
    surplus_volume: float = Field(description="volume that the passes add beyond the reached deposit")
    unreachable_volume: float = Field(description="volume of the deposit that no pass fills")
    unreached: list[UnreachedReport] = Field(description="that volume by reason")
    clearance: Bound = Field(
        description="least distance of the nozzle from metal, earlier deposits, fixture and layers below during "
        "deposition; null: none is near"
    )
    travel_clearance: Bound = Field(description="the same least distance between passes")
    setup: list[list[float]] | None = Field(
        description="with 3 axes: transform (4 rows) of a point of the part's frame to the frame in which the part is "
        "set up, z along the tool; the path's files are in that frame. Null: they are in the part's frame"
    )
    fill: BeadFillReport | None = Field(description="null where it was not simulated")
    files: list[str]
    notes: list[str]


def report_path(site: Site, written: ExportedFiles) -> PathReport | None:
    path = site.path
    if path is None:
        return None
    files = [name for name in written.files if strip_frame(name).startswith(f"path/site-{site.id}.")]
    return PathReport.read(path, layer_heights=path.heights, unreachable_volume=path.unreached_volume, files=files)

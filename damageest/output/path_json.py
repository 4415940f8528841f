"""What result.json says of a site's deposition path."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import BeadFill, DepositPath, Unreached, Vector
from damageest.output.base import Bound, JsonModel, strip_frame
from damageest.result import Site
from damageest.stages.export import ExportedFiles


class UnreachedReport(JsonModel, of=Unreached): ...


class BeadFillReport(
    JsonModel,
    of=BeadFill,
    fields="voxel filled gap largest_gap void spill spill_distance sunk of_deposit air air_95",
):
    """The union of the beads against the deposit, on voxels. Heat, flow and shrinkage are not simulated."""


class PathReport(
    JsonModel,
    of=DepositPath,
    fields="passes layers layer_form directions layer_heights length travel minutes wait_minutes bead_volume "
    "deposit_volume surplus_volume unreachable_volume=unreached_volume unreached clearance travel_clearance setup "
    "fill files notes",
):
    """The passes that build up the deposit. Times are those of the feeds, without acceleration."""

    layers: int
    directions: list[Vector] = Field(description="build direction of each part of the deposit")
    layer_heights: list[float] = Field(description="height of the layers in each part of the deposit")
    minutes: float
    clearance: Bound
    travel_clearance: Bound
    setup: list[list[float]] | None
    files: list[str]


def report_path(site: Site, written: ExportedFiles) -> PathReport | None:
    path = site.path
    if path is None:
        return None
    files = [name for name in written.files if strip_frame(name).startswith(f"path/site-{site.id}.")]
    return PathReport.read(path, layer_heights=path.heights, unreachable_volume=path.unreached_volume, files=files)

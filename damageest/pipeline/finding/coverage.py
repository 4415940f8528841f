"""Steps about what the scan shows of the skin: before sites are looked for, and after they are found."""

from __future__ import annotations

from dataclasses import replace

from damageest.artefacts import DAMAGE, INTACT, Deviation
from damageest.errors import StageError
from damageest.findings import Coverage
from damageest.geometry.scan_field import ScanField
from damageest.pipeline.state import FoundSite
from damageest.pipeline.steps import step
from damageest.stages.segment import Segment
from damageest.trust.scan_quality import require_intact
from damageest.trust.skin.coverage import SkinView, measure_coverage
from damageest.trust.skin.facing import find_turned
from damageest.trust.skin.ray_evidence import trace_rays
from damageest.trust.skin.skin_cells import cut_skin, find_seen
from damageest.trust.views.two_sheets import Sheets, measure_sheets


@step(gives=("skin", "deviation", "sheets"))
def inspect_skin(field: ScanField, segmenter: Segment | None) -> tuple[SkinView, Deviation, Sheets]:
    """Maps what the scan shows of the skin, and labels as damage the points that lie on no skin: those that face
    another way, and those that rays reached through lost metal. Looks for two surfaces over the same skin. Raises
    StageError where too few points near the part are intact."""
    _check_intact(field, segmenter)
    label = field.label.copy()
    label[find_turned(field)] = DAMAGE
    deviation = replace(field.deviation, label=label)
    cells = cut_skin(field.part, field.aligned.spacing)
    seen, perhaps_seen, distance = find_seen(cells, replace(field, deviation=deviation))
    rays = trace_rays(field, cells, seen, perhaps_seen)
    if rays is not None:
        rooted = deviation.label.copy()
        rooted[rays.roots[rooted[rays.roots] == INTACT]] = DAMAGE
        deviation = replace(deviation, label=rooted)
    sheets = measure_sheets(replace(field, deviation=deviation))
    return SkinView(cells, seen, perhaps_seen, distance, rays), deviation, sheets


def _check_intact(field: ScanField, segmenter: Segment | None) -> None:
    try:
        require_intact(field.distance, field.tolerance, field.part)
    except StageError as error:
        error.stage, error.use = "segment", segmenter.use if segmenter else ""
        raise


@step(gives="coverage")
def describe_coverage(field: ScanField, skin: SkinView, found: tuple[FoundSite, ...]) -> Coverage:
    """Measures the share of the skin that the scan shows, and describes the rest."""
    losses = [site.damage for site in found]
    return measure_coverage(field.part, skin, losses, field.tolerance, field.aligned.spacing)

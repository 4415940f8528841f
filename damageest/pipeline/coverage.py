"""Steps about what the scan shows of the skin: before sites are looked for, and after they are found."""

from __future__ import annotations

from dataclasses import replace

from damageest.artefacts import DAMAGE, INTACT
from damageest.checks.coverage import SkinView, measure_coverage
from damageest.checks.facing import find_turned
from damageest.checks.ray_evidence import trace_rays
from damageest.checks.skin_cells import cut_skin, find_seen
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import JobState, Work


def inspect_skin(engine: Engine, work: Work) -> Work:
    """Maps what the scan shows of the skin, and labels as damage the points that lie on no skin: those that face
    another way, and those that rays reached through lost metal."""
    state = work.job
    part, aligned, deviation, tolerance = state.part, state.aligned, state.deviation, state.tolerance
    label = deviation.label.copy()
    label[find_turned(aligned, part, deviation, tolerance)] = DAMAGE
    deviation = replace(deviation, label=label)
    cells = cut_skin(part, aligned.spacing)
    seen, perhaps_seen, distance = find_seen(cells, part, aligned, deviation, tolerance)
    rays = trace_rays(part, cells, seen, perhaps_seen, aligned, tolerance)
    if rays is not None:
        rooted = deviation.label.copy()
        rooted[rays.roots[rooted[rays.roots] == INTACT]] = DAMAGE
        deviation = replace(deviation, label=rooted)
    sources = (JobState.part, JobState.aligned, JobState.deviation, JobState.tolerance)
    view = SkinView(cells, seen, perhaps_seen, distance, rays)
    state = state.derive(JobState.skin, view, *sources)
    return replace(work, job=state.derive(JobState.deviation, deviation, *sources))


def describe_coverage(engine: Engine, work: Work) -> Work:
    """Measures the share of the skin that the scan shows, and describes the rest."""
    state = work.job
    skin = state.skin
    losses = [site.damage for site in work.sites]
    coverage = measure_coverage(state.part, skin, losses, state.tolerance, state.aligned.spacing)
    key = digest("coverage", state.key("skin"), [site.key("damage") for site in work.sites])
    return replace(work, job=state.with_value(JobState.coverage, coverage, key))

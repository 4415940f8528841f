"""Steps that judge the sites, and follow what a person decided about them in the job."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from damageest.artefacts import Reason
from damageest.errors import StageError
from damageest.findings import Level
from damageest.geometry.scan_field import ScanField
from damageest.geometry.solids import to_solid, unite
from damageest.geometry.voxels import measure_area
from damageest.job.model import Accept, SiteChoice
from damageest.pipeline.finding.lost_bodies import BY_RAYS_ALONE
from damageest.pipeline.finding.sites import number_sites
from damageest.pipeline.placing.datums import choose_on_datums, has_datums
from damageest.pipeline.state import FoundSite, JobState, Reasons
from damageest.pipeline.steps import step
from damageest.rules import FreePose, SiteCase, SiteFacts
from damageest.trust.doubts.one_motion import are_sound
from damageest.trust.evidence import weigh_evidence
from damageest.trust.interval.free_pose import describe_motion
from damageest.trust.skin.coverage import SkinView, find_removed_cells
from damageest.trust.verdict import apply_to_sites, compare_sites, decide, measure_facts, open_end

BY_RAYS = 0.5
"""Share of a site's unseen skin that rays have to have passed through, for the loss to be proven by them."""
JUDGED_BY = ("field", "skin", "coverage", "pose", "unit", "views", "aligner")
"""What the facts of a site are gathered from."""


@step(gives=("found", "warnings"))
def choose_sites(
    found: tuple[FoundSite, ...], choice: SiteChoice, field: ScanField
) -> tuple[tuple[FoundSite, ...], Reasons]:
    """Numbers the sites, and drops and merges them as the job says. Numbers stay those of a run without these
    decisions."""
    found = number_sites(found)
    _check_numbers("sites.drop", choice.drop, found)
    for group in choice.merge:
        _check_numbers("sites.merge", group, found)
    sites = {site.number: site for site in found if site.number not in choice.drop}
    warnings = [Reason("site_dropped", f"site {number} was dropped, as the job says") for number in choice.drop]
    for group in choice.merge:
        members = [sites.pop(number) for number in sorted(set(group)) if number in sites]
        if members:
            sites[members[0].number] = _merge(members, field)
            named = ", ".join(str(one.number) for one in members)
            warnings.append(Reason("sites_merged", f"sites {named} were merged, as the job says"))
    if choice.keep is not None:
        low, high = np.array(choice.keep.min), np.array(choice.keep.max)
        for number, site in list(sites.items()):
            middle = site.damage.bounds.mean(axis=0)
            if not ((middle >= low) & (middle <= high)).all():
                del sites[number]
                text = f"site {number} was dropped: its middle is outside the box of sites.keep"
                warnings.append(Reason("site_dropped", text))
    return tuple(sites[number] for number in sorted(sites)), warnings


@step(gives="found", reads=("found", "accept", "rules", "terms", "errors", *JUDGED_BY))
def judge_sites(state: JobState) -> tuple[FoundSite, ...]:
    """Gives each site its verdict, and takes as damage those that the job accepts."""
    accept = state.accept
    if not isinstance(accept, str):
        _check_numbers("accept", accept, state.found)
    done = []
    each = _gather_all_facts(state)
    for site, facts, reasons in zip(
        state.found, each, apply_to_sites(state.rules, each, state.errors.facts), strict=True
    ):
        interval = open_end(facts.interval, reasons)
        verdict = decide(facts.volume, interval, reasons, facts.uncertainty.certain if facts.uncertainty else 0.0)
        uncertainty = replace(site.uncertainty, volume_95=interval) if site.uncertainty else None
        done.append(
            replace(
                site, verdict=verdict, uncertainty=uncertainty, accepted=is_accepted(accept, verdict.level, site.number)
            )
        )
    return tuple(done)


def is_accepted(accept: Accept, level: Level, number: int) -> bool:
    """Whether a site is part of the damage: a word names the least level; numbers add doubtful sites to `likely`."""
    if accept == "all":
        return True
    if accept == "proven":
        return level == "proven"
    return level != "doubtful" or (not isinstance(accept, str) and number in accept)


def _gather_all_facts(state: JobState) -> list[SiteFacts]:
    """The facts of each site, with what the others say about it."""
    held = bool(state.found) and _is_held_by_datums(state)
    each = [_gather_site_facts(state, site, held) for site in state.found]
    return compare_sites(state.rules, each, state.errors.facts)


def _is_held_by_datums(state: JobState) -> bool:
    """Whether datums that are sound hold the pose."""
    if not has_datums(state.aligner):
        return False
    field = state.field
    on = choose_on_datums(state.aligner, field.part, field.feet, field.deviation.face)
    return on is not None and are_sound(field.distance, on, field.tolerance)


def _gather_site_facts(state: JobState, site: FoundSite, held: bool) -> SiteFacts:
    """``held``: whether datums that are sound hold the pose: then one motion of all other skin is what it has lost."""
    # from the nearest skin, whichever: what moved by an error of pose or views is moved from there
    field, members = state.field, site.members
    depth, points = -field.distance[members], field.points
    typical, deepest = (float(np.quantile(depth, q)) for q in (0.5, 0.95)) if len(depth) else (0.0, 0.0)
    facts = SiteFacts(
        volume=site.damage.volume,
        area=measure_area(points[members], state.skin.cells.edge) if len(depth) else 0.0,
        damage_area=site.damage.area,
        count=len(depth),
        typical=typical,
        deepest=deepest,
        evidence=site.evidence,
        interval=site.uncertainty.volume_95 if site.uncertainty else None,
        uncertainty=site.uncertainty,
        by_rays=_is_proven_by_rays(state.skin, site),
        free=tuple(
            FreePose(describe_motion(one.motion, state.unit), *one.ends, one.moved * one.reach)
            for one in site.dependences
        ),
        displaced=site.displaced,
        twins=site.twins,
        bent_wall=site.bent_wall,
        covered=site.covered,
        beyond=site.beyond.amount,
        beyond_words=site.beyond.reason,
        beyond_at=site.beyond.at,
        other_volume=site.other_volume,
        terms=state.terms,
    )
    case = SiteCase(
        site.damage, members, field, state.errors.facts, state.skin, state.coverage, state.pose, state.views, held
    )
    return measure_facts(state.rules, case, facts)


def _check_numbers(field: str, numbers: Iterable[int], sites: tuple[FoundSite, ...]) -> None:
    known = [site.number for site in sites]
    if unknown := [number for number in numbers if number not in known]:
        there = f"there are: {', '.join(map(str, known))}" if known else "no site was found"
        raise StageError(f"{field} names site {unknown[0]}; {there}", f"change {field} in the job")


def _merge(members: list[FoundSite], field: ScanField) -> FoundSite:
    first = members[0]
    origin = first.damage.bounds.mean(axis=0)
    damage = to_solid(unite((site.damage for site in members), origin), origin) or first.damage
    points = np.unique(np.concatenate([site.members for site in members]))
    evidence = weigh_evidence(damage, field.points[points], field)
    whole = replace(
        first,
        clusters=tuple(sorted({cluster for site in members for cluster in site.clusters})),
        members=points,
        evidence=evidence,
        notes=tuple(dict.fromkeys(note for site in members for note in site.notes)),
        enclosures=tuple({id(solid): solid for site in members for solid in site.enclosures}.values()),
    )
    return whole.with_value(FoundSite.damage, damage)


def _is_proven_by_rays(skin: SkinView, site: FoundSite) -> bool:
    """Whether rays passed through most of the skin that the site removes and that has no scan points."""
    if skin.rays is None:
        return False
    if site.method == BY_RAYS_ALONE:
        return True
    index = np.flatnonzero(find_removed_cells(site.damage, skin) & ~skin.perhaps_seen)
    area = skin.cells.areas[index]
    return bool(len(index)) and float(area[skin.rays.lost[index]].sum()) > BY_RAYS * float(area.sum())

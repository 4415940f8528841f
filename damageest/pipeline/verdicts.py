"""Steps that judge the sites, and follow what a person decided about them in the job."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from damageest.checks.beyond_points import ask_beyond_points
from damageest.checks.coverage import SkinView, find_removed_cells
from damageest.checks.evidence import weigh_evidence
from damageest.checks.free_pose import ask_free_pose, measure_dependence
from damageest.checks.unseen_rim import ask_unseen_rim
from damageest.checks.verdict import judge_site, measure_limits
from damageest.errors import StageError
from damageest.geometry.solids import to_solid, unite
from damageest.geometry.voxels import measure_area
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.lost_bodies import BY_RAYS_ALONE
from damageest.pipeline.state import FoundSite, Work
from damageest.stages.align import Align

BY_RAYS = 0.5
"""Share of a site's unseen skin that rays have to have passed through, for the loss to be proven by them."""


def choose_sites(engine: Engine, work: Work) -> Work:
    """Drops and merges sites as the job says. Numbers stay those of a run without these decisions."""
    choice = engine.job.sites
    _check_numbers("sites.drop", choice.drop, work.sites)
    for group in choice.merge:
        _check_numbers("sites.merge", group, work.sites)
    sites = {site.number: site for site in work.sites if site.number not in choice.drop}
    warnings = [f"site {number} was dropped, as the job says" for number in choice.drop]
    for group in choice.merge:
        members = [sites.pop(number) for number in sorted(set(group)) if number in sites]
        if members:
            sites[members[0].number] = _merge(engine, members)
            warnings.append(f"sites {', '.join(str(one.number) for one in members)} were merged, as the job says")
    if choice.keep is not None:
        low, high = np.array(choice.keep.min), np.array(choice.keep.max)
        for number, site in list(sites.items()):
            middle = site.damage.bounds.mean(axis=0)
            if not ((middle >= low) & (middle <= high)).all():
                del sites[number]
                warnings.append(f"site {number} was dropped: its middle is outside the box of sites.keep")
    ordered = tuple(sites[number] for number in sorted(sites))
    return replace(work, sites=ordered, warnings=(*work.warnings, *warnings))


def judge_sites(engine: Engine, work: Work) -> Work:
    """Gives each site its verdict. A doubtful site is no part of the damage unless the job accepts it."""
    state, accept = work.job, engine.job.accept
    if accept != "all":
        _check_numbers("accept", accept, work.sites)
    limits = measure_limits(
        state.skin, state.aligned, state.deviation, state.surplus, state.tolerance, state.unit,
        is_fitted=engine.job.implementations[Align].name != "none" and not state.pose.is_held,
    )  # fmt: skip
    done = []
    reach = 2 * max(state.tolerance, state.aligned.spacing)
    for site in work.sites:
        area = measure_area(state.aligned.points[site.members], state.skin.cells.edge) if len(site.members) else 0.0
        dependences = measure_dependence(site.damage, state.part, state.pose)
        against, questions = ask_free_pose(dependences, site.damage.volume, state.unit)
        by_rays = _is_proven_by_rays(state.skin, site)
        at_rim = ask_unseen_rim(site.damage, state.part, state.coverage, reach)
        against, questions = (*against, *at_rim[0]), (*questions, *at_rim[1])
        if not by_rays:
            beyond = ask_beyond_points(
                site.damage, state.part, state.aligned.points[site.members], state.aligned.points,
                state.aligned.noise, state.aligned.spacing, state.tolerance, state.unit,
            )  # fmt: skip
            if beyond.is_contradicted:
                against = (*against, beyond.reason)
            elif beyond.reason:
                questions = (*questions, beyond.reason)
        verdict = judge_site(
            site.evidence, -state.deviation.distance[site.members], area, state.pose, limits,
            by_rays, site.damage.area, (*site.questions, *questions), (*site.doubts, *against),
        )  # fmt: skip
        accepted = verdict.level != "doubtful" or accept == "all" or site.number in accept
        rates = tuple(one.rate for one in dependences)
        done.append(replace(site, verdict=verdict, accepted=accepted, volume_rates=rates))
    return replace(work, sites=tuple(done))


def _check_numbers(field: str, numbers: Iterable[int], sites: tuple[FoundSite, ...]) -> None:
    known = [site.number for site in sites]
    if unknown := [number for number in numbers if number not in known]:
        there = f"there are: {', '.join(map(str, known))}" if known else "no site was found"
        raise StageError(f"{field} names site {unknown[0]}; {there}", f"change {field} in the job")


def _merge(engine: Engine, members: list[FoundSite]) -> FoundSite:
    first, job = members[0], members[0].job
    origin = first.damage.bounds.mean(axis=0)
    damage = to_solid(unite((site.damage for site in members), origin), origin) or first.damage
    points = np.unique(np.concatenate([site.members for site in members]))
    evidence = weigh_evidence(damage, job.aligned.points[points], job.aligned, job.deviation, job.part, job.tolerance)
    whole = replace(
        first,
        clusters=tuple(sorted({cluster for site in members for cluster in site.clusters})),
        members=points,
        evidence=evidence,
        notes=tuple(dict.fromkeys(note for site in members for note in site.notes)),
        enclosures=tuple({id(solid): solid for site in members for solid in site.enclosures}.values()),
    )
    return whole.with_value(FoundSite.damage, damage, digest(damage))


def _is_proven_by_rays(skin: SkinView, site: FoundSite) -> bool:
    """Whether rays passed through most of the skin that the site removes and that has no scan points."""
    if skin.rays is None:
        return False
    if site.method == BY_RAYS_ALONE:
        return True
    index = np.flatnonzero(find_removed_cells(site.damage, skin) & ~skin.perhaps_seen)
    area = skin.cells.areas[index]
    return bool(len(index)) and float(area[skin.rays.lost[index]].sum()) > BY_RAYS * float(area.sum())

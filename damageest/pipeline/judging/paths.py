"""The step round the stage `path`: what is left of the part, and which sites are built up before."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from damageest.artefacts import Deposit, Part, Solid
from damageest.errors import StageError
from damageest.geometry.remaining import subtract_from_part
from damageest.geometry.solids import to_solid, unite
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import Failures, FoundSite, JobState
from damageest.pipeline.steps import step
from damageest.stages.path import Path


@step(gives=("found", "failures"), reads=("found", "part"), calls=(Path,))
def plan_paths(engine: Engine, state: JobState) -> tuple[tuple[FoundSite, ...], Failures]:
    """Plans the path of each accepted site with a deposit, in the order that the implementation gives. A site that it
    refuses keeps its deposit and has no path."""
    stage = engine.job.stages[Path]
    assert isinstance(stage, Path)
    needs = type(stage).needs()
    chosen = [site for site in state.found if site.accepted and not site.refused]
    left = _find_left(chosen, state.part) if "left" in needs else None
    left_key = digest(left)
    done: dict[int, FoundSite] = {}
    failures: list[StageError] = []
    before: list[Solid] = []
    ranks = {each.number: engine.ask(Path, partial(stage.rank_site, each.number), int) for each in chosen}
    for site in sorted(chosen, key=lambda each: (ranks[each.number], each.number)):
        built = _unite_built(before, state.part) if "built" in needs else None
        site = site.with_value(FoundSite.body, site.deposit or site.damage)
        site = site.with_value(FoundSite.left, left, left_key).with_value(FoundSite.built, built)
        before.append(site.body)
        try:
            done[site.number] = engine.call(Path, replace(site, job=state))
        except StageError as error:
            failures.append(error)
    return tuple(done.get(site.number) or site.with_value(FoundSite.path, None) for site in state.found), failures


def _find_left(sites: list[FoundSite], part: Part) -> Solid | None:
    """The part without the cavities of the sites; None where nothing is left."""
    if not sites:
        return part
    lost, openings = zip(*map(_find_cavity, sites), strict=True)
    return subtract_from_part(part, lost, openings=openings)


def _find_cavity(site: FoundSite) -> tuple[Solid, Solid | None]:
    """The cavity of a site, and what takes it out of the part, where that is known."""
    deposit = site.deposit
    if isinstance(deposit, Deposit) and deposit.cavity:
        return deposit.cavity, deposit.opening if deposit.milled is not None else None
    return site.damage, None


def _unite_built(before: list[Solid], part: Part) -> Solid | None:
    origin = part.bounds.mean(axis=0)
    return to_solid(unite(before, origin), origin)

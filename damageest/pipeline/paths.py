"""The step round the stage `path`: what is left of the part, and which sites are built up before."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from damageest.artefacts import Deposit, Solid
from damageest.errors import StageError
from damageest.geometry.solids import subtract_lost, to_manifold, to_solid, unite
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, Step
from damageest.pipeline.state import FoundSite, JobState, Work
from damageest.registry.contracts import Contract
from damageest.stages.path import Path


def plan_paths(path: Contract) -> Step:
    """A step that calls the contract on each accepted site with a deposit, in the order that its implementation gives.
    A site that it refuses keeps its deposit and has no path."""

    def run(engine: Engine, work: Work) -> Work:
        stage = engine.job.stages[path]
        assert isinstance(stage, Path)
        needs = type(stage).needs()
        chosen = [site for site in work.sites if site.accepted and not site.refused]
        left = _find_left(chosen, work.job) if "left" in needs else None
        key = digest("left", work.job.key("part"), [(site.key("damage"), site.key("deposit")) for site in chosen])
        done: dict[int, FoundSite] = {}
        failures: list[StageError] = []
        before: list[FoundSite] = []
        ranks = {each.number: engine.ask(path, partial(stage.rank_site, each.number), int) for each in chosen}
        for site in sorted(chosen, key=lambda each: (ranks[each.number], each.number)):
            body = site.deposit or site.damage
            source = "deposit" if site.deposit else "damage"
            built = _unite_built(before, work.job) if "built" in needs else None
            site = site.with_value(FoundSite.body, body, digest("body", site.key(source)))
            site = site.with_value(FoundSite.left, left, key)
            site = site.with_value(FoundSite.built, built, digest("built", [each.key("body") for each in before]))
            before.append(site)
            try:
                done[site.number] = engine.call(path, site)
            except StageError as error:
                failures.append(error)
        sites = tuple(done.get(site.number) or _without_path(site) for site in work.sites)
        return replace(work, sites=sites, failures=(*work.failures, *failures))

    return run


def _without_path(site: FoundSite) -> FoundSite:
    return site.with_value(FoundSite.path, None, digest("no path", site.key("damage")))


def _find_left(sites: list[FoundSite], job: JobState) -> Solid | None:
    """The part without the cavities of the sites; None where nothing is left."""
    if not sites:
        return job.part
    origin = job.part.bounds.mean(axis=0)
    cavities = [_find_cavity(site) for site in sites]
    return to_solid(subtract_lost(to_manifold(job.part, origin), unite(cavities, origin)), origin)


def _find_cavity(site: FoundSite) -> Solid:
    deposit = site.deposit
    return deposit.cavity if isinstance(deposit, Deposit) and deposit.cavity else site.damage


def _unite_built(before: list[FoundSite], job: JobState) -> Solid | None:
    origin = job.part.bounds.mean(axis=0)
    return to_solid(unite([site.body for site in before], origin), origin)

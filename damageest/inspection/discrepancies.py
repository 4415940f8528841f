"""What a scan after a step of a repair shows beyond what was to be: losses and surplus, with the sites they lie on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Vector
from damageest.geometry.solids import to_manifold
from damageest.geometry.vectors import to_vector
from damageest.inspection.aim import Aim, cut_volume
from damageest.inspection.places import Landed
from damageest.result import Result

ELSEWHERE = 0
"""Number of the site that stands for the rest of the part."""
FEWEST = 3
"""Points of a finding on a site's skin from which it lies there."""
FIXED = 0.5
"""Share of the points of a surplus that lie in fixtures, above which it is one."""
BESIDE = 0.05
"""Share of a finding's points, and `FEWEST` of them, that lie on no site's skin where it lies elsewhere too."""
Kind = Literal["missing", "stock short", "over"]


@dataclass(frozen=True)
class Finding:
    """``kind``: "missing": metal as designed that is not there; "stock short": stock that is not there; "over": metal
    beyond the target. ``sites``: all that it lies on, 0 for elsewhere; ``site``: the one with most of it. ``volume``
    with its 95 % interval, None where there is none. ``depth``: largest distance from the target surface. ``level``:
    confidence in the volume."""

    kind: Kind
    site: int
    volume: float
    low: float | None
    high: float | None
    depth: float
    centre: Vector
    level: str
    sites: tuple[int, ...] = ()


def list_findings(aim: Aim, result: Result, landed: Mapping[int, Landed], fixed: Flags) -> tuple[Finding, ...]:
    """What is missing, what is short and what is over. ``landed``: the points on each site's skin; ``fixed``
    (N,): which points of the scan lie in fixtures."""
    of = np.zeros(len(result.aligned.points), np.int64)
    for number, one in landed.items():
        of[one.index] = number
    return (*_list_missing(aim, result, of), *_list_over(result, of, fixed))


def name_places(sites: Sequence[int]) -> str:
    """The place of a finding as text."""
    numbers = sorted(number for number in sites if number)
    named = [f"site{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"] if numbers else []
    return " and ".join([*named, *(["elsewhere"] if ELSEWHERE in sites else [])])


def _list_missing(aim: Aim, result: Result, of: Ints) -> list[Finding]:
    found = []
    whole = to_manifold(aim.nominal)
    for site in result.sites:
        below = cut_volume(site.damage, whole)
        above = max(site.damage.volume - below, 0.0)
        sites = _find_sites(of[site.points], result.deviation.distance[site.points], result.tolerance)
        interval = site.volume_95
        low, high = (None, None) if interval is None else interval
        total = below + above
        at = to_vector(site.centroid)
        kinds: tuple[tuple[Kind, float], ...] = (("missing", below), ("stock short", above))
        for kind, volume in kinds:
            if volume > 0.02 * total:
                share = volume / total
                least, most = (None if end is None or not np.isfinite(end) else end * share for end in (low, high))
                found.append(
                    Finding(kind, sites[0], volume, least, most, site.max_depth, at, site.verdict.level, sites)
                )
    return found


def _list_over(result: Result, of: Ints, fixed: Flags) -> list[Finding]:
    found = []
    for item in result.surplus:
        if item.kind == "surroundings" or fixed[item.points].mean() > FIXED:
            continue
        sites = _find_sites(of[item.points], result.deviation.distance[item.points], result.tolerance)
        at = to_vector(result.aligned.points[item.points].mean(axis=0))
        volume = item.volume if item.volume is not None else item.estimate
        level = "likely" if item.solid is not None else "estimated"
        found.append(Finding("over", sites[0], float(volume), None, None, float(item.height), at, level, sites))
    return found


def _find_sites(of: Ints, distance: Floats, tolerance: float) -> tuple[int, ...]:
    """The sites that a finding's points lie on, most of them first; `ELSEWHERE` among them where some lie on none."""
    away = np.abs(distance) > tolerance
    of = of[away] if away.any() else of
    counts = np.bincount(of, minlength=1)
    order = [int(number) for number in np.argsort(-counts, kind="stable") if counts[number]]
    least = dict.fromkeys(order, FEWEST)
    least[ELSEWHERE] = max(FEWEST, int(np.ceil(BESIDE * len(of))))
    return tuple(number for number in order if counts[number] >= least[number]) or tuple(order[:1]) or (ELSEWHERE,)

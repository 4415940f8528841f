"""The volume of a site by the method that did not make it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from damageest.pipeline.state import FoundSite


def note_other_volumes(
    sites: tuple[FoundSite, ...], first: tuple[FoundSite, ...], second: tuple[FoundSite, ...]
) -> tuple[FoundSite, ...]:
    """The sites, each with its volume by the other of two routes; NaN where that has no sites for the same clusters.

    Where the routes divide the clusters in other ways, the volumes of all sites that share some are compared: a site
    has the same share of both sums.
    """
    return tuple(
        replace(site, other_volume=_find_other(site, *((second, first) if site in first else (first, second))))
        for site in sites
    )


def _find_other(site: FoundSite, others: tuple[FoundSite, ...], own: tuple[FoundSite, ...]) -> float:
    clusters = set(site.clusters)
    while True:  # until no site of either route has clusters in the group and others out of it
        alike = [one for one in (*own, *others) if clusters & set(one.clusters)]
        more = clusters.union(*(one.clusters for one in alike))
        if more == clusters:
            break
        clusters = more
    if _list_clusters(own, clusters) != clusters or _list_clusters(others, clusters) != clusters:
        return math.nan
    mine, its = _sum_volumes(own, clusters), _sum_volumes(others, clusters)
    return site.damage.volume * its / mine if mine > 0 else math.nan


def _list_clusters(sites: Iterable[FoundSite], clusters: set[int]) -> set[int]:
    return {cluster for site in sites for cluster in site.clusters if cluster in clusters}


def _sum_volumes(sites: Iterable[FoundSite], clusters: set[int]) -> float:
    return sum(site.damage.volume for site in sites if clusters & set(site.clusters))

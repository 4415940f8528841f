"""The 95 % intervals of volumes and depths: what the errors of a site add up to, and those of all sites together.

Errors that have nothing to do with one another add as squares: those of noise. Errors that all sites share add as they
are: a wrong pose moves all inner surfaces, a deviating form is everywhere, and edges and rims are rounded in each to
the same side. Motions that the scan does not exclude move the ends of the interval: any amount of them is as likely.
What unseen surface may hide, what fades out, and what a field took for form makes a volume larger and never smaller.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from damageest.artefacts import Floats
from damageest.findings import Interval
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.scanner import Distribution, Figure

WIDTH = 2.0
"""Half the width of a 95 % interval in standard deviations."""

MARGIN = 1.25
"""By how much larger the errors of a site are taken for what of it is certain: a loss of one depth is then none where
the low end of its interval is a fifth of it."""


class Term(ABC):
    """One source of uncertainty, a term of the interval and a row of the budget.

    ``name``: of the source, the same from version to version; ``text``: the source in words; ``type``: A, from this
    scan by statistics, or B, from other knowledge (JCGM 100); ``rank``: its place in the budget, the lowest first.
    ``words`` and ``remedy``: how the reason `wide_interval` names it, and what makes it smaller; empty: it does not.
    ``bound``: the name of what moves one end of the interval, where it is not the term's.
    ``is_own``: different in each site, and not common to all. ``is_of_surface``: an error of the inner surface itself,
    and not of the skin above it. ``is_of_points``: the depth of each scan point has it as well.
    """

    name: ClassVar[str]
    text: ClassVar[str]
    type: ClassVar[Literal["A", "B"]]
    distribution: ClassVar[Distribution] = "normal"
    words: ClassVar[str] = ""
    remedy: ClassVar[str] = ""
    bound: ClassVar[str] = ""
    rank: ClassVar[int] = 1000
    is_own: ClassVar[bool] = False
    is_of_surface: ClassVar[bool] = False
    is_of_points: ClassVar[bool] = True
    owner: str = ""
    """The plugin that it is from, which the registry sets; empty for those of damageest."""

    @abstractmethod
    def measure(self, case: LossCase) -> Share | None:
        """What the source makes of a loss; None where it is not known."""


@dataclass(frozen=True, eq=False)
class Share:
    """What a source makes of a site, each as one standard deviation.

    ``volume``: change of the volume, signed where sites may differ in sign; (J,) for a source of J independent errors.
    ``depth``: of the largest depth. ``source``: standard uncertainty of the source in the job's unit, 0: what moves the
    inner surface by as much. ``figure``: of the certificate, where it is the source. ``low``, ``high``: by how much the
    volume may be smaller and larger beyond that, at most: metal that nothing shows.
    """

    volume: float | Floats = 0.0
    depth: float = 0.0
    source: float = 0.0
    figure: Figure | None = None
    low: float = 0.0
    high: float = 0.0

    @property
    def columns(self) -> Floats:
        """(J,) the changes of the volume."""
        return np.atleast_1d(np.asarray(self.volume, float))


@dataclass(frozen=True, eq=False)
class SiteError:
    """The errors of one site's volume, each as one standard deviation, and of its largest depth.

    ``shares``: of the terms, in the order of the budget. ``excess``: by how much the volume is too large on average;
    ``rates`` (M,): change of the volume for each unit of each free motion, by the other field of an adapted part, and
    where its growth is the scan's; ``motions`` (M,2): their ends. ``depth``: of the damage volume, corrected for its
    mean error; ``depth_free``: change by the free motions. ``corner``: how far a corner of the inner surface goes
    beyond the volume and its scan points. ``measured``: the largest depth of a scan point, with what its noise, the
    pose and the skin may be off, and the corner. ``exposed``: the area that is moved against the skin by what deviates.
    ``depths`` (Q,): quantiles of how deep the loss is over that area: where it is shallow, no more than that is in
    doubt.
    """

    volume: float
    shares: tuple[tuple[Term, Share], ...] = ()
    excess: float = 0.0
    rates: Floats = field(default_factory=lambda: np.empty(0))
    motions: Floats = field(default_factory=lambda: np.empty((0, 2)))
    depth: float = 0.0
    corner: float = 0.0
    measured: float = np.inf
    depth_free: float = 0.0
    exposed: float = 0.0
    depths: Floats = field(default_factory=lambda: np.empty(0))

    @property
    def depth_error(self) -> float:
        """Standard deviation of the largest depth."""
        return float(np.sqrt(sum(share.depth**2 for _, share in self.shares)))

    @property
    def low(self) -> float:
        """By how much the volume may be smaller beyond its deviations."""
        return sum(share.low for _, share in self.shares)

    @property
    def high(self) -> float:
        """By how much the volume may be larger beyond its deviations."""
        return sum(share.high for _, share in self.shares)

    def measure_terms(self) -> dict[str, float]:
        """The standard deviation of the volume by each term."""
        return {term.name: float(np.linalg.norm(share.columns)) for term, share in self.shares}

    @property
    def free(self) -> Interval:
        """Least and largest change of the volume by the free motions."""
        return _sweep(self.rates, self.motions)


def combine_site(error: SiteError) -> tuple[Interval, Interval]:
    """The 95 % intervals of volume and depth of one site. No depth is beyond what its scan points show.

    A surface through points rounds a corner, always to the same side: that moves the high end of the depth alone.
    """
    depth = min(error.depth, error.measured)
    depth_high = min(depth + WIDTH * error.depth_error + error.corner, error.measured) + error.depth_free
    depth_low = depth - WIDTH * error.depth_error - error.depth_free
    return combine_total(error.volume, [error]), (max(depth_low, 0.0), depth_high)


def combine_total(volume: float, errors: Sequence[SiteError], doubtful: float = 0.0, margin: float = 1.0) -> Interval:
    """The 95 % interval of the sites' ``volume`` together, which is in the unit's third power, and at least 0.

    ``doubtful``: volume of sites that are not part of the damage, and may be. ``margin``: how many times larger the
    errors are taken at the low end.
    """
    if not errors:
        return volume, volume + doubtful
    variances = [(term, sum_variance(term, each)) for term, each in gather_shares(errors)]
    deviation = float(np.sqrt(sum(variance for _, variance in variances)))
    more = sum(one.high for one in errors)
    free = sum_free(errors)
    middle = volume - sum(one.excess for one in errors)
    of_surface = sum(variance for term, variance in variances if term.is_of_surface)
    own = WIDTH * float(np.sqrt(of_surface)) + max(volume - middle, 0.0)
    taken = margin * (volume - min(middle - WIDTH * deviation, volume) - free[0])
    low = volume - _limit_taken(errors, taken, min(margin * own, taken)) - sum(one.low for one in errors)
    high = max(middle + WIDTH * deviation, volume) + free[1] + more
    return max(low, 0.0), high + doubtful


def gather_shares(errors: Sequence[SiteError]) -> list[tuple[Term, list[Share]]]:
    """The shares of the sites by term, in the order of the budget."""
    found: dict[str, tuple[Term, list[Share]]] = {}
    for term, share in sorted((pair for one in errors for pair in one.shares), key=lambda pair: pair[0].rank):
        found.setdefault(term.name, (term, []))[1].append(share)
    return list(found.values())


def sum_columns(term: Term, shares: Iterable[Share]) -> Floats:
    """(J,) the independent errors that a term has in some sites together: its own ones in each stay apart, common ones
    add with their sign."""
    each = [share.columns for share in shares if share.columns.size]
    if not each:
        return np.empty(0)
    return np.concatenate(each) if term.is_own else np.asarray(np.sum(each, axis=0))


def sum_variance(term: Term, shares: Iterable[Share]) -> float:
    """The variance of the volume of some sites together by a term."""
    return float((sum_columns(term, shares) ** 2).sum())


def measure_certain(error: SiteError) -> float:
    """The volume of the piece of a site that is lost also where its errors are a quarter larger."""
    return combine_total(error.volume, [error], margin=MARGIN)[0]


def _limit_taken(errors: Sequence[SiteError], taken: float, own: float) -> float:
    """What is ``taken`` off the sites' volume at its low end: by skin that may lie deeper, no more
    than what is lost there. ``own``: the part of it that is in the inner surface, and not in the skin."""
    exposed = sum(one.exposed for one in errors)
    if exposed <= 0 or taken <= own:
        return taken
    deeper = (taken - own) / exposed
    share = sum(
        one.exposed * (float(np.minimum(one.depths, deeper).mean()) / deeper if len(one.depths) else 1.0)
        for one in errors
    )
    return own + (taken - own) * share / exposed


def sum_free(errors: Sequence[SiteError]) -> Interval:
    """Least and largest change of the sites' volume together by the free motions."""
    moving = [one for one in errors if len(one.rates)]  # a whole body that is lost has none
    return _sweep(np.sum([one.rates for one in moving], axis=0), moving[0].motions) if moving else (0.0, 0.0)


def _sweep(rates: Floats, motions: Floats) -> Interval:
    """Least and largest sum of changes at rates (M,) by motions between their ends (M,2), 0 among them."""
    ends = rates[:, None] * motions
    low, high = np.minimum(ends.min(axis=1, initial=0), 0).sum(), np.maximum(ends.max(axis=1, initial=0), 0).sum()
    return float(low), float(high)

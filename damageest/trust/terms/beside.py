"""The unseen skin beside a site: the loss may go on there."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Solid
from damageest.findings import Coverage
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term
from damageest.trust.skin.unseen_rim import find_unseen_beside

BESIDE = 2.0
"""Distance from a damage volume, in reaches, within which unseen skin may be part of the same loss."""


class Beside(Term):
    name = "beside"
    text = "unseen skin beside the site"
    type = "B"
    remedy = "scan the skin beside the damage"
    rank = 230

    def measure(self, case: LossCase) -> Share | None:
        if case.coverage is None:
            return None
        reach = BESIDE * max(2 * case.tolerance, 1.5 * case.field.aligned.spacing)
        return Share(high=limit_beside(case.coverage, case.loss.damage, case.loss.inner, reach, case.depth))


def limit_beside(coverage: Coverage, damage: Solid, inner: Flags, reach: float, depth: float) -> float:
    """By how much a loss may be larger where skin beside it, within ``reach``, is not seen: over all of that region, as
    deep as it is itself, ``depth``. ``inner`` (F,): which of its faces are inside the part."""
    touched = np.unique(coverage.region[find_unseen_beside(coverage, damage, inner, reach)])
    regions = [coverage.unseen[number] for number in touched]
    return float(sum(min(one.volume, one.area * depth) for one in regions))

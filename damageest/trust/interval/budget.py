"""Budgets of uncertainty as JCGM 100 (GUM) asks for: the errors of a volume or a depth as a table, source by source.

The volume is a sum of independent inputs, each with a standard uncertainty of one and its coefficient: the combined
uncertainty is the root of the sum of their squares (JCGM 100, 5.1.2). What all sites have in common is one input in all
of them, so that it adds with its sign. Tests compare it with the GUM Tree Calculator.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.findings import Budget, BudgetBound, BudgetRow
from damageest.trust.interval.scanner import Figure
from damageest.trust.interval.site_error import WIDTH, SiteError, Term, gather_shares, sum_columns

UNKNOWN = {
    "probing_form": "probing form error",
    "probing_size": "probing size error",
    "length": "length measurement error",
    "temperature": "temperature of the part",
    "temperature_uncertainty": "uncertainty of the temperature",
    "expansion_uncertainty": "uncertainty of the coefficient of expansion",
}
"""What a job may leave out, in words."""


def make_volume_budget(
    errors: Sequence[SiteError], unit: str, doubtful: float = 0.0, free: tuple[float, float] = (0.0, 0.0)
) -> Budget | None:
    """The budget of the volume of one site, or of all sites together; None where no site has an error.

    Args:
        doubtful: volume of sites that are not accepted, and may be damage. free: change by free motions.
    """
    measured = [one for one in errors if one.exposed]
    if not measured:
        return None
    area = sum(one.exposed for one in measured)
    rows = []
    for term, shares in gather_shares(measured):
        columns = sum_columns(term, shares)
        source = shares[0].source or float(np.linalg.norm(columns)) / area
        rows.append(_Row(term, columns, source, unit, shares[0].figure))
    bounds = [
        BudgetBound("free", "motions that the scan leaves free", *free),
        *_list_bounds(errors),
        BudgetBound("doubtful", "sites that are not accepted, and places that may be damage", 0.0, doubtful),
    ]
    return _sum_up(rows, bounds, -sum(one.excess for one in errors))


def _list_bounds(errors: Sequence[SiteError]) -> list[BudgetBound]:
    """What moves one end of the interval, of each term."""
    found = []
    for term, shares in gather_shares(errors):
        low, high = sum(share.low for share in shares), sum(share.high for share in shares)
        found.append(BudgetBound(term.bound or term.name, term.text, -low, high))
    return found


def make_depth_budget(error: SiteError, unit: str) -> Budget | None:
    """The budget of the largest depth of one site; None where it has no error."""
    rows = [_Row(term, np.array([share.depth]), share.depth, unit, share.figure) for term, share in error.shares]
    if not any(share.depth for _, share in error.shares):
        return None
    bounds = [BudgetBound("free", "motions that the scan leaves free", -error.depth_free, error.depth_free)]
    if error.depth + WIDTH * error.depth_error > error.measured:
        most = max(error.measured - error.depth, 0.0)
        bounds.append(BudgetBound("measured", "ends at what the scan points show", -np.inf, most))
    return _sum_up(rows, bounds, 0.0)


@dataclass(frozen=True)
class _Row:
    """What a ``term`` makes of the result: of each of the independent errors (J,) that it consists of.
    ``uncertainty``: of the source in ``unit``, where it is no ``figure`` of the certificate. A figure
    has a row though it changes nothing."""

    term: Term
    columns: Floats
    uncertainty: float
    unit: str
    figure: Figure | None


def _sum_up(parts: Iterable[_Row], bounds: Iterable[BudgetBound], correction: float) -> Budget:
    """The budget, with the combined uncertainty and the contributions."""
    known = [part for part in parts if part.figure or part.columns.any()]
    combined = float(np.sqrt(sum(float((part.columns**2).sum()) for part in known)))
    rows = []
    for part in known:
        components = [float(c) for c in part.columns if c]
        contribution = float(np.linalg.norm(components)) if components else 0.0
        sign = -1.0 if len(components) == 1 and components[0] < 0 else 1.0
        term, figure = part.term, part.figure
        uncertainty = figure.uncertainty if figure else part.uncertainty
        rows.append(
            BudgetRow(
                source=term.name,
                text=term.text,
                type=term.type,
                distribution=figure.distribution if figure else term.distribution,
                uncertainty=uncertainty,
                unit=figure.unit if figure else part.unit,
                sensitivity=sign * contribution / uncertainty if uncertainty else 0.0,
                contribution=contribution,
                share=contribution**2 / combined**2 if combined else 0.0,
            )
        )
    kept = tuple(one for one in bounds if one.low or one.high)
    return Budget(tuple(rows), combined, WIDTH, WIDTH * combined, correction, kept)

"""Budgets of uncertainty as JCGM 100 (GUM) asks for: the errors of a volume or a depth as a table, source by source.

The volume is a sum of independent inputs, each with a standard uncertainty of one and its coefficient: the combined
uncertainty is the root of the sum of their squares (JCGM 100, 5.1.2). What all sites have in common is one input in all
of them, so that it adds with its sign. Tests compare it with the GUM Tree Calculator.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from damageest.artefacts import Floats
from damageest.findings import Budget, BudgetBound, BudgetRow
from damageest.trust.interval.scanner import ScannerErrors
from damageest.trust.interval.site_error import WIDTH, SiteError

Distribution = Literal["normal", "rectangular"]


@dataclass(frozen=True)
class Source:
    """``text``: the source in words; ``type``: A, from this scan by statistics, or B, from other knowledge."""

    text: str
    type: Literal["A", "B"]
    distribution: Distribution = "normal"


SOURCES: dict[str, Source] = {
    "noise": Source("noise of the points on the inner surface", "A"),
    "spacing": Source("surface between the points, calibrated on simulated damages", "B"),
    "rim": Source("where the inner surface meets the skin, calibrated on simulated damages", "B"),
    "pose": Source("pose, fitted to the intact points", "A"),
    "adapt": Source("adaptation of the part", "A"),
    "form": Source("intact skin that deviates over whole areas", "A"),
    "outward": Source("skin as far outside the part", "B"),
    "views": Source("disagreement of overlapping views", "A"),
    "tessellation": Source("tessellation of the CAD surface", "B", "rectangular"),
    "probing_form": Source("probing form error beyond the noise and the form that the scan shows", "B"),
    "probing_size": Source("probing size error: half of it is an offset of the surface", "B"),
    "length": Source("length measurement error over the part's diagonal, as a scale", "B"),
    "temperature": Source("temperature of the part", "B"),
    "expansion": Source("coefficient of expansion of the part", "B"),
    "fitted_scale": Source("scale of the scan, fitted to the part", "A"),
}
"""The sources of a budget, in the order of its rows."""
OWN = ("noise", "probing_form")
"""Sources that are different in each site."""
UNKNOWN = {
    "probing_form": "probing form error",
    "probing_size": "probing size error",
    "length": "length measurement error",
    "temperature": "temperature of the part",
    "temperature_uncertainty": "uncertainty of the temperature",
    "expansion_uncertainty": "uncertainty of the coefficient of expansion",
}
"""What a job may leave out, in words."""


@dataclass
class _Parts:
    """The contributions of one source: to the result, of each of the independent errors that it consists of (J,).
    ``uncertainty``: of the source in ``unit``; 0: there is no other measure than the result's."""

    name: str
    columns: Floats
    uncertainty: float = 0.0
    unit: str = ""
    distribution: Distribution | None = None
    is_told: bool = field(default=False)


def make_volume_budget(
    errors: Sequence[SiteError], scanner: ScannerErrors, noise: float, tessellation: float, unit: str,
    doubtful: float = 0.0, free: tuple[float, float] = (0.0, 0.0),
) -> Budget | None:  # fmt: skip
    """The budget of the volume of one site, or of all sites together; None where no site has an error.

    Args:
        noise: standard deviation of a scan point. tessellation: bound on the distance of CAD surface and triangles.
        doubtful: volume of sites that are not accepted, and may be damage. free: change by free motions.
    """
    measured = [one for one in errors if one.exposed]
    if not measured:
        return None
    area = sum(one.exposed for one in measured)

    def share(name: str) -> _Parts:
        """A source that is an error of the inner surface's place, the same for all sites."""
        value = np.array([sum(getattr(one, name) for one in measured)])
        return _Parts(name, value, float(value[0]) / area, unit)

    def gather(name: str) -> Floats:
        """What the sites have of each of the errors of a source that are independent of one another."""
        found = [getattr(one, name) for one in measured if len(getattr(one, name))]
        return np.asarray(np.sum(found, axis=0)) if found else np.empty(0)

    own = {name: np.array([getattr(one, name) for one in measured]) for name in OWN}
    parts = [
        _Parts("noise", own["noise"], noise, unit),
        *(share(name) for name in ("spacing", "rim")),
        *(_Parts(name, gather(name), float(np.linalg.norm(gather(name))) / area, unit) for name in ("pose", "adapt")),
        *(share(name) for name in ("form", "outward", "views")),
        _Parts("tessellation", share("tessellation").columns, tessellation / 3**0.5, unit),
        _Parts("probing_form", own["probing_form"], scanner.form, unit, is_told=bool(scanner.form)),
        *_list_terms(scanner, gather("scanner")),
    ]
    bounds = [
        BudgetBound("free", "motions that the scan leaves free", *free),
        BudgetBound("closed", "inner surface closed across unseen places", -sum(x.less for x in errors), 0.0),
        BudgetBound("inside", "inner surface without points", 0.0, sum(x.inside for x in errors)),
        BudgetBound("beside", "unseen skin beside the site", 0.0, sum(x.beside for x in errors)),
        BudgetBound("form", "adaptation that makes the part thinner", 0.0, sum(x.taken for x in errors)),
        BudgetBound("fading", "loss that fades out beyond the rim", 0.0, sum(x.fading for x in errors)),
        BudgetBound("doubtful", "sites that are not accepted, and places that may be damage", 0.0, doubtful),
    ]
    return _sum_up(parts, bounds, -sum(one.excess for one in errors))


def make_depth_budget(error: SiteError, scanner: ScannerErrors, unit: str) -> Budget | None:
    """The budget of the largest depth of one site; None where it has no error."""
    if not error.depth_by:
        return None
    parts = [_Parts(name, np.array([value]), value, unit) for name, value in error.depth_by.items()]
    parts += _list_terms(scanner, error.depth_scanner)
    bounds = [BudgetBound("free", "motions that the scan leaves free", -error.depth_free, error.depth_free)]
    if error.depth + WIDTH * error.depth_error > error.measured:
        most = max(error.measured - error.depth, 0.0)
        bounds.append(BudgetBound("measured", "ends at what the scan points show", -np.inf, most))
    return _sum_up(parts, bounds, 0.0)


def _list_terms(scanner: ScannerErrors, shares: Floats) -> list[_Parts]:
    if not len(shares):
        return []
    return [
        _Parts(one.name, shares[k : k + 1], one.uncertainty, one.unit, one.distribution, is_told=True)
        for k, one in enumerate(scanner.terms)
    ]


def _sum_up(parts: Iterable[_Parts], bounds: Iterable[BudgetBound], correction: float) -> Budget:
    """The budget, with the combined uncertainty and the contributions."""
    known = {part.name: part for part in parts if part.is_told or part.columns.any()}
    combined = float(np.sqrt(sum(float((part.columns**2).sum()) for part in known.values())))
    rows = []
    for name in (name for name in SOURCES if name in known):
        part, source = known[name], SOURCES[name]
        components = [float(c) for c in part.columns if c]
        contribution = float(np.linalg.norm(components)) if components else 0.0
        sign = -1.0 if len(components) == 1 and components[0] < 0 else 1.0
        rows.append(
            BudgetRow(
                source=name,
                text=source.text,
                type=source.type,
                distribution=part.distribution or source.distribution,
                uncertainty=part.uncertainty,
                unit=part.unit,
                sensitivity=sign * contribution / part.uncertainty if part.uncertainty else 0.0,
                contribution=contribution,
                share=contribution**2 / combined**2 if combined else 0.0,
            )
        )
    kept = tuple(one for one in bounds if one.low or one.high)
    return Budget(tuple(rows), combined, WIDTH, WIDTH * combined, correction, kept)

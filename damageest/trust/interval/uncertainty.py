"""The errors of a site's volume and of its largest depth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from damageest.artefacts import Flags, Floats, FreeMotion, Solid
from damageest.errors import StageError, clean_message, is_interrupt
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.skin import take_inner_surface
from damageest.isolation import at_work
from damageest.trust.interval.inner_surface import DEPTH_GAP, DEPTH_NOISE
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import WIDTH, Share, SiteError, Term

NOISY, SLOPE = 3.0, 0.7
"""By how many standard deviations of their noise the deepest of many points is deeper than those around it where it
lies in no corner of the inner surface; and the share of what it is deeper by, by which a corner goes beyond it: these
points are two gaps away, the deepest about one."""
PLACES = 500
"""Places on the skin at which the depth of a site is measured."""
QUANTILES = np.linspace(0.01, 0.99, 50)
"""Those of the depth that are kept of a site."""


def measure_site_error(case: LossCase, terms: Iterable[Term], free: Sequence[FreeMotion]) -> SiteError | None:
    """The errors of one site by the ``terms`` of the interval; None where no scan point lies on its inner surface.

    Args:
        free: motions that the scan does not exclude.
    """
    surface, loss, adapted = case.surface, case.loss, case.adapted
    if surface is None or loss.inner.all():
        return None
    aligned, part, damage = case.field.aligned, case.field.part, loss.damage
    shares = tuple((term, share) for term in terms if (share := measure_term(term, case)) is not None)
    rates = case.bent[0][-1:] if adapted is not None and adapted.other is not None else np.empty(0)
    if adapted is not None and adapted.growth:  # of the part, or of the scan's scale: then the loss is of another size
        rates = np.append(rates, damage.volume * ((1 + adapted.growth) ** -3 - 1))
    deepest = case.deepest
    by_points = sum(share.depth**2 for term, share in shares if term.is_of_points)
    by_point = float(np.sqrt(aligned.noise**2 + by_points + (DEPTH_NOISE * part.scan_noise) ** 2))
    # in a corner of the inner surface no point may be as deep as it is; where the floor is level, one is
    corner = min(SLOPE * max(deepest.rise - NOISY * aligned.noise, 0.0), WIDTH * DEPTH_GAP * surface.gap)
    return SiteError(
        volume=damage.volume,
        shares=shares,
        excess=surface.excess,
        rates=rates,
        motions=np.tile([0.0, 1.0], (len(rates), 1)),
        depth=case.depth,
        corner=corner,
        measured=deepest.measured + WIDTH * by_point + corner,
        depth_free=sum(
            max(-one.low, one.high) * abs(float(one.move(deepest.at[None])[0] @ deepest.normal)) for one in free
        ),
        exposed=case.exposed,
        depths=_measure_depths(damage, loss.inner),
    )


def measure_term(term: Term, case: LossCase) -> Share | None:
    """What a term makes of a loss. Raises StageError where that of a plugin fails: an interval without it would be too
    narrow."""
    if not term.owner:
        return term.measure(case)
    try:
        with at_work(f"term {term.name}", owner=term.owner):
            share = term.measure(case)
            if share is None or (np.isfinite(share.columns).all() and np.isfinite(share.depth)):
                return share
        why = "gave a share that is not finite"
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        why = f"failed: {type(error).__name__}: {clean_message(error, 400)}"
    raise StageError(
        f"the term {type(term).__qualname__} ('{term.name}') of {term.owner} {why}",
        f"report it to the authors of {term.owner}, or uninstall it",
    )


def _measure_depths(damage: Solid, inner: Flags) -> Floats:
    """Quantiles of how deep a loss is below places all over the skin that it removes."""
    places, _ = sample_by_area(damage, PLACES, np.random.default_rng(0), np.flatnonzero(~inner))
    return np.asarray(np.quantile(distance_to_mesh(places, take_inner_surface(damage, inner)), QUANTILES))

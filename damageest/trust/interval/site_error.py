"""The 95 % intervals of volumes and depths: what the errors of a site add up to, and those of all sites together.

Errors that have nothing to do with one another add as squares: those of noise. Errors that all sites share add as they
are: a wrong pose moves all inner surfaces, a deviating form is everywhere, and edges and rims are rounded in each to
the same side. Motions that the scan does not exclude move the ends of the interval: any amount of them is as likely.
What unseen surface may hide, what fades out, and what a field took for form makes a volume larger and never smaller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from damageest.artefacts import Floats
from damageest.findings import Interval

WIDTH = 2.0
"""Half the width of a 95 % interval in standard deviations."""

MARGIN = 1.25
"""By how much larger the errors of a site are taken for what of it is certain: a loss of one depth is then none where
the low end of its interval is a fifth of it."""


@dataclass(frozen=True, eq=False)
class SiteError:
    """The errors of one site's volume, each as one standard deviation, and of its largest depth.

    ``pose`` (K,): signed, by the columns of `PoseError.spread`; ``excess``: by how much the volume is too large on
    average; ``adapt`` (J,): signed, by the modes of an adapted part; ``rates`` (M,): change of the volume for each unit
    of each free motion, by the other field of an adapted part, and where its growth is the scan's; ``motions`` (M,2):
    their ends;
    ``inside`` (where points do not bound it), ``beside``, ``fading``, ``taken`` (what the field of an adapted part made
    thinner there, and wear may have): by how much the loss may be larger; ``less``: by
    how much it may be smaller, since the inner surface was closed across what was not seen. ``depth``: of the damage
    volume, corrected for its mean error; ``depth_error``: one standard deviation; ``depth_free``: change by the free
    motions. ``corner``: how far a corner of the inner surface goes beyond the volume and its scan points. ``measured``:
    the largest depth of a scan point, with what its noise, the pose and the skin may be off, and the corner.
    ``probing_form``, ``scanner`` (T,): by the certificate and the temperature, signed, by the terms of `ScannerErrors`;
    ``depth_scanner`` (T,): the same of the depth, and ``depth_by``: the other causes of ``depth_error``, by name.
    ``exposed``: the area that is moved against the skin by what deviates; ``curved``: that of skin made of chords.
    ``depths`` (Q,): quantiles of how deep the loss is over that area: where it is shallow, no more than that is in
    doubt.
    """

    volume: float
    noise: float
    spacing: float
    rim: float
    excess: float
    pose: Floats = field(default_factory=lambda: np.empty(0))
    tessellation: float = 0.0
    form: float = 0.0
    outward: float = 0.0
    views: float = 0.0
    adapt: Floats = field(default_factory=lambda: np.empty(0))
    rates: Floats = field(default_factory=lambda: np.empty(0))
    motions: Floats = field(default_factory=lambda: np.empty((0, 2)))
    inside: float = 0.0
    less: float = 0.0
    beside: float = 0.0
    fading: float = 0.0
    taken: float = 0.0
    depth: float = 0.0
    depth_error: float = 0.0
    corner: float = 0.0
    measured: float = np.inf
    depth_free: float = 0.0
    probing_form: float = 0.0
    scanner: Floats = field(default_factory=lambda: np.empty(0))
    depth_scanner: Floats = field(default_factory=lambda: np.empty(0))
    depth_by: Mapping[str, float] = field(default_factory=dict)
    exposed: float = 0.0
    curved: float = 0.0
    depths: Floats = field(default_factory=lambda: np.empty(0))

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
    alone = np.array([[one.noise, one.probing_form] for one in errors])
    shared = np.sum(
        [[one.spacing, one.rim, one.form, one.tessellation, one.outward, one.views] for one in errors], axis=0
    )
    told = np.sum([one.scanner for one in errors if len(one.scanner)], axis=0)
    moved = np.sum([one.pose for one in errors if len(one.pose)], axis=0)
    bent = np.sum([one.adapt for one in errors if len(one.adapt)], axis=0)
    squares = [(one**2).sum() for one in (alone, shared, moved, bent, told)]
    deviation = float(np.sqrt(sum(squares)))
    more = sum(one.inside + one.beside + one.fading + one.taken for one in errors)
    free = sum_free(errors)
    middle = volume - sum(one.excess for one in errors)
    own = WIDTH * float(np.sqrt((alone**2).sum() + (shared[:2] ** 2).sum())) + max(volume - middle, 0.0)
    taken = margin * (volume - min(middle - WIDTH * deviation, volume) - free[0])
    low = volume - _limit_taken(errors, taken, min(margin * own, taken)) - sum(one.less for one in errors)
    high = max(middle + WIDTH * deviation, volume) + free[1] + more
    return max(low, 0.0), high + doubtful


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

"""What of a body beside the part touches a site's finished skin is the part's; what hovers over it, or stands away from
it, is not."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.inspection.joined import Bodies, keep_joined
from damageest.inspection.places import Landed

TOLERANCE, SPACING = 0.2, 0.4


def land(skin: Floats, body: Floats) -> tuple[Landed, Bodies]:
    """Points on the skin and of one body, by their heights."""
    distance = np.concatenate([skin, body])
    count = len(distance)
    of = np.concatenate([np.zeros(len(skin), np.int64), np.ones(len(body), np.int64)])
    return Landed(np.arange(count), np.zeros((count, 6)), np.zeros(count, np.int64), distance), Bodies(of, 1)


@pytest.mark.parametrize(
    ("heights", "kept"),
    [
        ([0.3, 0.4, 0.5, 0.9, 1.2, 9.0, 20.0], 5),  # a bead on the site, joined to a bar above it
        ([5.0, 5.1, 6.0, 9.0], 0),  # a clamp over the site
        ([0.5, 5.0, 6.0, 7.0], 0),  # the same with a stray point
    ],
)
def test_a_body_counts_where_it_touches(heights: list[float], kept: int) -> None:
    landed, bodies = land(np.zeros(20), np.array(heights))
    found = keep_joined(landed, bodies, TOLERANCE, SPACING)
    assert len(found.index) == 20 + kept

"""Points on the part's skin near the damage, for implementations that take them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import ADDED, INTACT, Samples, Sites
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin_near import NearCubes, find_cubes_near, sample_near
from damageest.pipeline.steps import step
from damageest.stages.enclose import EncloseAll

EDGE_SPACINGS, MOST_EDGE = 16.0, 40.0
"""Edge of the cubes in which skin is near damage, in spacings of the scan and, at most, in tolerances: in cubes with
fewer points it is a matter of chance whether the scan shows their skin."""
FINE, FINE_SPACINGS = 6.0, 3.0
"""Distance from damaged points up to which the points on the skin are a tolerance apart, in tolerances, and in spacings
of the scan: there lies the rim. It reaches at most twice as far."""


@step(gives="nearby")
def sample_near_damage(field: ScanField, sites: Sites, encloser_at_once: EncloseAll | None) -> Samples:
    """Points on the part's skin near the damage: a tolerance apart about the rim and where the scan shows no skin, two
    elsewhere."""
    part, aligned, tolerance = field.part, field.aligned, field.tolerance
    on_skin = (field.label == INTACT) | (field.label == ADDED)
    damaged = np.flatnonzero(sites.label > 0)
    places, intact = aligned.points[damaged], aligned.points[on_skin]
    feet = field.find_feet(damaged)
    reach = encloser_at_once.nearby_reach if encloser_at_once else MOST_EDGE
    edge = max(reach * tolerance, min(EDGE_SPACINGS * aligned.spacing, MOST_EDGE * tolerance))
    near, unseen = find_cubes_near(part, places, feet, intact, edge)
    # where the scan ends beside damage, the surface ends somewhere beyond its points: wide samples would let it go on
    fine = NearCubes.around(np.concatenate([places, unseen]), max(FINE * tolerance, FINE_SPACINGS * aligned.spacing))
    return sample_near(part, near, fine, tolerance)

"""Added metal on the way through the route: its volume, and the losses beside it, against known truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import damageest
from damageest.artefacts import ADDED, Floats, Scan
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import iou, to_solid
from damageest.registry import Registry
from damageest.result import Result
from tests.pipeline.halfway import run_until
from tests.surplus_scenes import TOLERANCE, ball, block, part, scan, slab, table


def run(points: Floats, **more: Any) -> Result:
    job = {"version": 1, "tolerance": TOLERANCE, "align": "none", "method": "implicit", **more}
    return damageest.run(job, part=part(), scan=points)


@pytest.mark.slow
def test_a_bead_and_a_loss_beside_it_are_both_right() -> None:
    actual = block() - ball(3, -4, 0, 7.5) + slab((8, 10, 2), 3, 0, 6)  # 0.4 apart
    result = run(np.concatenate([scan(actual), table()]))
    (site,) = result.sites
    assert iou(to_solid(block() - actual), site.damage) > 0.9
    bead, plane = result.surplus
    assert bead.solid is not None
    assert iou(to_solid(actual - block()), bead.solid) > 0.9
    assert signed_distance(bead.solid.vertices, part())[0].min() > -1e-6
    assert abs(bead.area - 80) < 8
    assert bead.clusters == site.clusters
    assert (plane.kind, plane.solid) == ("surroundings", None)
    assert [note.code for note in result.warnings].count("surroundings") == 1
    assert (result.deviation.label[plane.points] == ADDED).all()
    assert result.mesh("surplus", 1) is bead.solid
    assert {"cluster": 1, "enclose": 1}.items() <= {s.stage: 1 for s in result.stages}.items()
    assert [s.stage for s in result.stages].count("cluster") == 1


@pytest.mark.slow
def test_a_loss_under_a_bead_is_right_where_it_is_seen_and_named() -> None:
    actual = block() - ball(4, 0, 0, 6) + slab((6, 10, 4), 3, 0, 6)
    result = run(scan(actual))
    (site,) = result.sites
    assert iou(to_solid(block() - actual), site.damage) > 0.85
    assert site.verdict.level == "likely"
    assert "covered" in [reason.code for reason in site.verdict.reasons]


@pytest.mark.slow
def test_a_bead_is_right_and_no_loss(registry: Registry) -> None:
    actual = block() + slab((8, 10, 2), 3, 0, 6)
    points = Scan(scan(actual, 12_000))
    job = {"tolerance": 0.2, "align": "none", "adapt": "none", "method": "implicit"}
    state = run_until("fit_model", part(), points, registry, **job).state
    assert state.sites.count == 0
    (bead,) = state.surplus
    assert bead.solid is not None
    assert iou(to_solid(actual - block()), bead.solid) > 0.9
    assert signed_distance(bead.solid.vertices, part())[0].min() > -1e-6
    assert abs(bead.area - 80) < 8
    assert (state.deviation.label[bead.points] == ADDED).all()


@pytest.mark.slow
def test_without_added_metal_there_is_no_surplus() -> None:
    assert run(scan(block() - ball(3, 0, 0, 7), 5000)).surplus == ()


def test_surplus_over_most_of_the_skin_is_another_pose_or_part() -> None:
    with pytest.raises(StageError, match="does not lie on the part"):
        run(scan(slab((24, 18, 13), 0, 0, 0) + slab((12, 19, 13), 0, 0, 0), 5000), adapt="none")


@pytest.mark.slow
def test_tape_and_powder_on_intact_skin_leave_the_volume_right() -> None:
    damaged = block() - ball(4, -6, 0, 7)
    tape = slab((6, 18, 0.4), 6, 0, 6.2)  # over the edges, 2 to 3 tolerances thick
    rng = np.random.default_rng(4)
    powder = np.column_stack([rng.normal([7, -6], 1.0, (300, 2)), 6 + np.abs(rng.normal(0, 0.5, 300))])
    result = run(np.concatenate([scan(damaged + tape), powder]), align="register")
    (site,) = [site for site in result.sites if site.damage.volume > 1]
    lost = block().volume() - damaged.volume()
    assert site.uncertainty is not None
    low, high = site.uncertainty.volume_95
    assert low < lost < high < 1.3 * lost
    assert abs(site.damage.volume - lost) < 0.05 * lost
    assert site.accepted
    assert result.surplus

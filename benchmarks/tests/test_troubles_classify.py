"""Right, wrong but said, wrong and silent: the definition on results made by hand, on a box with two dents."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.troubles.classify import (
    TrueState,
    find_motion,
    judge,
    judge_error,
    measure_seen_error,
)

from damageest.artefacts import Deviation, Evidence, Part, Pose, Reason, Scan, Solid, Surface
from damageest.findings import Coverage, Uncertainty, UnseenRegion, Verdict
from damageest.geometry.solids import to_arrays
from damageest.result import Result, Site

TOLERANCE = 0.2
EYE = np.eye(4)


def _make_box(low: tuple[float, ...], high: tuple[float, ...]) -> Solid:
    from manifold3d import Manifold

    return Solid(*to_arrays(Manifold.cube(tuple(np.subtract(high, low))).refine(6).translate(low)))


_BOX = _make_box((0, 0, 0), (40, 30, 20))
PART = Part(_BOX.vertices, _BOX.faces)
DENT = _make_box((5, 5, 16), (12, 12, 20))
OTHER = _make_box((25, 15, 16), (32, 22, 20))
FALSE = _make_box((25, 2, 0), (30, 6, 3))
BOTH = Solid(
    np.concatenate([DENT.vertices, OTHER.vertices]), np.concatenate([DENT.faces, OTHER.faces + len(DENT.vertices)])
)


def _make_site(solid: Solid, accepted: bool = True, **fields: Any) -> Site:
    ids = Surface(solid.vertices, solid.faces)
    verdict = (
        Verdict()
        if accepted
        else Verdict("doubtful", (Reason("nothing", "its depth of 0.3 is near the tolerance", "widens"),))
    )
    points = np.empty(0, np.int64)
    site = Site(1, (1,), points, solid, ids, None, "implicit", Evidence(), 4.0, verdict=verdict, accepted=accepted)
    return replace(site, **fields)


def _make_result(*sites: Site, **fields: Any) -> Result:
    scan = Scan(PART.vertices)
    count = len(scan.points)
    deviation = Deviation(np.zeros(count), np.zeros(count, np.int64), np.zeros(count, np.uint8))
    known: dict[str, Any] = {
        "name": "hand", "units": "mm", "tolerance": TOLERANCE, "part": PART, "scan": scan, "aligned": scan,
        "pose": Pose(EYE), "deviation": deviation, "site_label": np.zeros(count, np.int32), "sites": sites,
        "damage": None, "undamaged": PART, "warnings": (), "failures": (), "truth": None, "volume_95": (0.0, 0.0),
    }  # fmt: skip
    return Result(**(known | fields))


def _judge(result: Result, damage: Solid | None = BOTH, pose: Any = EYE) -> Any:
    return judge(result, TrueState(PART, damage, pose))


def _make_coverage(low: tuple[float, ...], high: tuple[float, ...]) -> Coverage:
    """Skin between two corners is unseen."""
    middle = PART.triangles.mean(axis=1)
    unseen = ((middle > low) & (middle < high)).all(axis=1)
    bounds = np.array([low, high])
    region = UnseenRegion(100.0, bounds.mean(0), bounds, (), 300.0)
    nothing = np.zeros(len(unseen), np.bool_)
    return Coverage(0.9, (region,), PART, ~unseen, np.zeros(len(unseen)), nothing, np.where(unseen, 0, -1))


def test_right_sites_are_right() -> None:
    found = _judge(_make_result(_make_site(DENT), _make_site(OTHER)))
    assert (found.outcome, found.reason, found.unseen) == ("right", "", 0)
    assert found.iou == pytest.approx(1)


def test_no_site_on_an_undamaged_part_is_right() -> None:
    found = _judge(_make_result(), None)
    assert found.outcome == "right"
    assert np.isnan(found.iou)


def test_a_doubtful_false_site_beside_right_ones_is_right() -> None:
    assert _judge(_make_result(_make_site(BOTH), _make_site(FALSE, False))).outcome == "right"


def test_an_accepted_false_site_is_silent() -> None:
    found = _judge(_make_result(_make_site(BOTH), _make_site(FALSE)))
    assert found.outcome == "silent"
    assert found.reason == "1 false sites with 60 in volume"
    assert _judge(_make_result(_make_site(FALSE)), None).outcome == "silent"


def test_a_missed_damage_is_silent_unless_it_is_tiny() -> None:
    found = _judge(_make_result(_make_site(DENT)))
    assert found.outcome == "silent"
    assert "1 damages missed with 196 in volume" in found.reason
    tiny = _make_box((25, 15, 19.3), (25.8, 15.8, 20))
    assert tiny.volume < (4 * TOLERANCE) ** 3
    assert _judge(_make_result(), tiny).outcome == "right"
    coarse = judge(_make_result(tolerance=2.0), TrueState(PART, DENT, EYE, tolerance=TOLERANCE))
    assert coarse.outcome == "silent", "a coarse tolerance does not make the damage tiny"


def test_a_missed_damage_on_skin_reported_as_unseen_is_right_and_counted() -> None:
    hidden = _judge(_make_result(_make_site(DENT), coverage=_make_coverage((20, 10, 19), (40, 30, 21))))
    assert (hidden.outcome, hidden.unseen) == ("right", 1)
    elsewhere = _judge(_make_result(_make_site(DENT), coverage=_make_coverage((0, 0, -1), (40, 30, 1))))
    assert elsewhere.outcome == "silent"


def test_a_missed_damage_on_skin_reported_as_lost_is_said() -> None:
    coverage = _make_coverage((20, 10, 19), (40, 30, 21))
    found = _judge(_make_result(_make_site(DENT), coverage=replace(coverage, is_lost=coverage.region >= 0)))
    assert (found.outcome, found.unseen) == ("said", 0)


def test_a_doubtful_site_on_the_damage_is_said() -> None:
    found = _judge(_make_result(_make_site(DENT), _make_site(OTHER, False)))
    assert (found.outcome, found.cautious) == ("said", True)
    assert found.reason.startswith("1 damages missed")
    wrong = _make_box((25, 15, 12), (32, 22, 20))
    assert _judge(_make_result(_make_site(DENT), _make_site(wrong, False))).cautious is False
    elsewhere = _judge(_make_result(_make_site(DENT), _make_site(FALSE, False)))
    assert elsewhere.outcome == "silent", "the doubtful site says nothing of the missed damage"


def test_a_wrong_volume_is_silent_and_shallow_damage_has_wider_limits() -> None:
    deeper = _make_box((5, 5, 15), (12, 12, 20))
    found = _judge(_make_result(_make_site(deeper)), DENT)
    assert (found.outcome, found.reason) == ("silent", "IoU 0.80, volume error +25%")
    true, shallow = _make_box((5, 5, 19.6), (15, 15, 20)), _make_box((5, 5, 19.5), (15, 15, 20))
    assert _judge(_make_result(_make_site(shallow)), true).outcome == "right"
    half = _make_box((5, 5, 19.7), (15, 10, 20))
    assert _judge(_make_result(_make_site(half)), true).outcome == "silent"


def test_a_wrong_volume_with_the_truth_in_its_interval_is_inside() -> None:
    deeper = _make_box((5, 5, 15), (12, 12, 20))
    wide = Uncertainty((DENT.volume - 1, deeper.volume + 50), None)
    found = _judge(_make_result(_make_site(deeper, uncertainty=wide)), DENT)
    assert (found.outcome, found.groups[0].holds) == ("inside", True)
    narrow = Uncertainty((deeper.volume - 1, deeper.volume + 1), None)
    assert _judge(_make_result(_make_site(deeper, uncertainty=narrow)), DENT).outcome == "silent"
    shallow = _make_box((5, 5, 18), (12, 12, 20))
    open_end = Uncertainty((shallow.volume - 1, np.inf), None)
    assert _judge(_make_result(_make_site(shallow, uncertainty=open_end)), DENT).outcome == "inside"


def test_a_missed_damage_is_said_where_the_total_is_not_known() -> None:
    known = _make_result(_make_site(DENT, uncertainty=Uncertainty((190, 200), None)), volume_95=(190.0, 200.0))
    assert _judge(known).outcome == "silent"
    assert _judge(replace(known, volume_95=None)).outcome == "said"


def test_sites_and_bodies_that_overlap_are_one_group() -> None:
    exact = Uncertainty((195.0, 197.0), None)
    result = _make_result(_make_site(DENT, uncertainty=exact), _make_site(OTHER, False), _make_site(FALSE))
    groups = sorted(_judge(result).groups, key=lambda group: (group.truth, group.accepted))
    assert [(group.truth > 0, group.accepted) for group in groups] == [(False, 1), (True, 0), (True, 1)]
    assert [group.holds for group in groups if group.accepted] == [False, True]
    assert not np.isfinite(groups[1].high), "a doubtful site without an interval claims no upper end"


def test_the_pose_has_to_be_right_up_to_listed_symmetries() -> None:
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    half_turn[:2, 3] = 40, 30
    same = find_motion(PART, Pose(EYE), EYE, TOLERANCE)
    assert same is not None
    assert np.array_equal(same, EYE)
    assert find_motion(PART, Pose(half_turn), EYE, TOLERANCE) is None
    listed = Pose(half_turn, alternatives=np.array([EYE]))
    noted = Pose(half_turn, notes=("the part fits at any angle (continuous symmetry)",))
    for pose in (listed, noted):
        motion = find_motion(PART, pose, EYE, TOLERANCE)
        assert motion is not None
        assert np.allclose(motion, half_turn)
    shifted = EYE.copy()
    shifted[0, 3] = 1
    assert find_motion(PART, replace(noted, T_part_scan=shifted), EYE, TOLERANCE) is None
    turned = Solid(DENT.vertices @ half_turn[:3, :3].T + half_turn[:3, 3], DENT.faces)
    assert _judge(_make_result(_make_site(turned), pose=listed), DENT).outcome == "right"
    assert _judge(_make_result(_make_site(DENT), pose=Pose(shifted)), DENT).outcome == "silent"


def test_without_a_right_pose_only_doubt_is_said() -> None:
    assert _judge(_make_result(), None, pose=None).outcome == "silent"
    assert _judge(_make_result(volume_95=None), None, pose=None).outcome == "said"
    assert _judge(_make_result(_make_site(FALSE, False)), None, pose=None).outcome == "said"
    assert _judge(_make_result(_make_site(FALSE, False), _make_site(DENT)), None, pose=None).outcome == "silent"


def test_a_run_that_is_refused_claims_nothing() -> None:
    said = judge_error("align: none: only 12 % of the points lie within the tolerance of the part's surface")
    assert (said.outcome, said.refused) == ("said", True)


def test_the_error_of_the_seen_share_is_in_points() -> None:
    assert measure_seen_error(None, 0.5) is None
    assert measure_seen_error(_make_coverage((0, 0, 0), (1, 1, 1)), 0.85) == pytest.approx(5)

"""The verdict: what speaks against a site makes it doubtful, what could not be asked makes it likely."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Evidence, Pose
from damageest.checks.verdict import ScanLimits, judge_site
from damageest.findings import Verdict

LIMITS = ScanLimits(tolerance=0.2, spacing=0.3, unit="mm")
DEEP = np.full(500, 1.0)


def judge(
    evidence: Evidence | None = None, depth: np.ndarray = DEEP, limits: ScanLimits = LIMITS, **more: object
) -> Verdict:
    options: dict[str, object] = {"pose": Pose(np.eye(4)), "proven_by_rays": False, "volume_area": 100.0, **more}
    return judge_site(evidence or Evidence(), depth, 40.0, limits=limits, **options)  # type: ignore[arg-type]


def test_nothing_against_a_deep_site_with_many_points() -> None:
    assert judge() == Verdict("proven", ())


OPEN: dict[str, Any] = {"consistent": False, "reasons": ("30% of the skin beside it",), "causes": ("unseen",)}
CASES = {
    "contradicted": (
        {"evidence": Evidence(consistent=False, reasons=("8 intact points",), causes=("inside",))},
        "doubtful",
    ),
    "unseen beside it": ({"evidence": Evidence(skin_unseen=0.3, **OPEN)}, "likely"),
    "mostly unseen beside it": ({"evidence": Evidence(skin_unseen=0.6, **OPEN)}, "doubtful"),
    "inner surface in part unseen": ({"evidence": Evidence(ids_unseen=0.3)}, "likely"),
    "inner surface mostly unseen": ({"evidence": Evidence(ids_unseen=0.6)}, "doubtful"),
    "a hole in the inner surface": ({"evidence": Evidence(ids_unseen=0.1, ids_gap=3.0)}, "doubtful"),
    "a small hole in it": ({"evidence": Evidence(ids_unseen=0.05, ids_gap=3.0)}, "likely"),
    "rim not clear": ({"evidence": Evidence(intact_share=0.4)}, "likely"),
    "few points": ({"depth": DEEP[:60]}, "likely"),
    "stray points": ({"depth": DEEP[:8]}, "doubtful"),
    "shallow": ({"depth": 0.28 * DEEP}, "likely"),
    "within the systematic deviation": ({"limits": replace(LIMITS, systematic=0.3)}, "doubtful"),
    "skin as far outside": ({"limits": replace(LIMITS, outward_area=30.0, outward_height=0.6)}, "doubtful"),
    "little skin outside": ({"limits": replace(LIMITS, outward_area=5.0, outward_height=0.6)}, "proven"),
    "views disagree": ({"limits": replace(LIMITS, between_views=0.8)}, "doubtful"),
    "views disagree by less": ({"limits": replace(LIMITS, between_views=0.4)}, "proven"),
    "wide and shallow, fitted": (
        {"depth": 0.5 * DEEP, "limits": replace(LIMITS, is_fitted=True, seen_area=200.0)},
        "doubtful",
    ),
    "wide and shallow, known pose": ({"depth": 0.5 * DEEP, "limits": replace(LIMITS, seen_area=200.0)}, "proven"),
    "a wall of half the depth, by rays": ({"depth": 0.1 * DEEP, "proven_by_rays": True}, "proven"),
    "by rays, inner surface open": ({"evidence": Evidence(ids_gap=10.0), "proven_by_rays": True}, "doubtful"),
    "by rays, within the deviation": (
        {"depth": DEEP, "limits": replace(LIMITS, systematic=0.3), "proven_by_rays": True},
        "doubtful",
    ),
    "pose not sure": ({"pose": Pose(np.eye(4), doubts=("two poses fit",))}, "doubtful"),
    "displaced piece": ({"doubts": ("surplus 1 is as large",)}, "doubtful"),
    "under surplus": ({"unknown": ("surplus 1 lies on its skin",)}, "likely"),
    "proven by rays": ({"depth": DEEP[:0], "proven_by_rays": True}, "proven"),
}


@pytest.mark.parametrize("name", CASES)
def test_level_and_reason(name: str) -> None:
    options, level = CASES[name]
    found = judge(**options)  # type: ignore[arg-type]
    assert found.level == level, found
    assert bool(found.reasons) == (level != "proven")

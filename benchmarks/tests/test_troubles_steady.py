"""Scans that are drawn again: which sites count as the same, and as steady."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.troubles.steady import SteadyCase, compare_sites, make_steady_table, run_steady
from damageest_benchmarks.troubles.suite import make_trouble_cases
from manifold3d import Manifold

from damageest.artefacts import Pose, Solid
from damageest.findings import Verdict
from damageest.geometry.solids import to_arrays


def make_result(*sites: Any, others: Any = None) -> Any:
    return SimpleNamespace(sites=sites, pose=Pose(np.eye(4), alternatives=others))


def make_site(at: float, level: Any, interval: tuple[float, float], edge: float = 2.0) -> Any:
    damage = Solid(*to_arrays(Manifold.cube((edge, 2, 2), True).translate((at, 0, 0))))
    return SiteLike(damage, Verdict(level), level != "doubtful", interval)


@dataclass(frozen=True)
class SiteLike:
    damage: Solid
    verdict: Verdict
    accepted: bool
    volume_95: tuple[float, float]


def test_sites_are_matched_by_their_place() -> None:
    base = make_result(make_site(0, "likely", (7, 9)), make_site(20, "proven", (7.9, 8.1)))
    again = make_result(make_site(20.2, "proven", (8, 8.4), 2.1), make_site(0.1, "doubtful", (0, 9)))
    first, second = compare_sites("other points", base, again)
    assert (first["before"], first["after"], first["accepted"], first["inside"]) == (
        "likely",
        "doubtful",
        [True, False],
        True,
    )
    assert (second["after"], second["inside"]) == ("proven", False)
    table = make_steady_table([{"sites": [first, second]}])
    assert table[-1] == ["all", "2", "50%", "50%", "100%", "50%"]


def test_a_site_that_is_gone_is_told() -> None:
    (gone,) = compare_sites("half the points", make_result(make_site(0, "likely", (7, 9))), make_result())
    assert (gone["after"], gone["accepted"]) == ("none", [True, False])


def test_the_other_pose_of_a_symmetric_part_is_the_same_site() -> None:
    half = np.diag([-1.0, -1.0, 1.0, 1.0])
    base = make_result(make_site(5, "likely", (7, 9)))
    (site,) = compare_sites("another frame", base, make_result(make_site(-5, "likely", (7, 9)), others=half[None]))
    assert site["after"] == "likely"


@pytest.mark.slow
def test_a_scan_drawn_again() -> None:
    (case,) = make_trouble_cases(numbers=[122], points=6000)
    row = run_steady(SteadyCase(**vars(case)))
    assert not row["error"]
    assert len(row["sites"]) == 3
    assert all(site["accepted"] == [True, True] for site in row["sites"])

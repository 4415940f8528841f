"""The cases: each kind makes a scan with its truth, and equal cases make equal scans."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from damageest_benchmarks.troubles.case import TroubleCase, make_scan, make_scene
from damageest_benchmarks.troubles.kinds import TROUBLES
from damageest_benchmarks.troubles.parts import NAMES, make_named_part
from damageest_benchmarks.troubles.report import format_trouble_row, make_trouble_tables
from damageest_benchmarks.troubles.suite import make_trouble_cases
from damageest_benchmarks.troubles.views import measure_seen_share, place_scanners, scan_surface

from damageest.artefacts import Mesh
from damageest.errors import InputError
from damageest.geometry.distance import distance_to_mesh

CASES = make_trouble_cases(points=400)
FIRST = [next(case for case in CASES if case.kind == kind) for kind in TROUBLES]


def test_the_suite_is_as_large_as_the_docs_say() -> None:
    kinds = Counter(case.kind for case in CASES)
    assert len(CASES) >= 80
    assert len(kinds) >= 20
    assert len({case.part for case in CASES}) >= 6
    assert {case.pose for case in CASES} == {"known", "unknown"}
    assert {case.views for case in CASES} == {0, 1, 2, 3, 8}
    assert [case.number for case in CASES] == list(range(1, len(CASES) + 1))
    assert len({case.compute_key() for case in CASES}) == len(CASES)
    assert {case.part for case in CASES} <= set(NAMES)


DEAR = ("wear: bore", "wear: half a shaft", "wear: one side of a journal")
"""Each takes 2 s and more to make."""


@pytest.mark.variants(10)
@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.slow] if case.kind in DEAR else [], id=case.kind) for case in FIRST],
)
def test_each_kind_makes_a_scan_with_its_truth(case: TroubleCase) -> None:
    scene = make_scene(case)
    assert 150 < len(scene.points) <= 1.2 * max(case.points, case.amount)
    assert np.isfinite(scene.points).all()
    assert 0 <= scene.seen <= 1
    if scene.damage is not None:
        assert 0 < scene.damage.volume < scene.part.volume
    scan, pose = make_scan(case, scene)
    assert (scan.viewpoints is not None) == (case.positions and case.views > 0)
    if scene.has_pose and scene.damage is None and not scene.added:
        distance = distance_to_mesh(scan.move(pose).points, scene.part)
        assert np.median(distance) < 0.05 * scene.part.diagonal


@pytest.mark.parametrize("kind", ["waviness", "stray cluster"])
def test_equal_cases_make_equal_scans_and_seeds_differ(kind: str) -> None:
    case = next(case for case in CASES if case.kind == kind)
    first, again = (make_scan(case, make_scene(case))[0] for _ in range(2))
    assert np.array_equal(first.points, again.points)
    other = make_scan(case, make_scene(replace(case, seed=1)))[0]
    assert not np.array_equal(first.points, other.points)


def test_positions_see_one_side_and_all_sides() -> None:
    part = make_named_part("cuboid")
    above = part.bounds.mean(axis=0) + np.array([[0, 0, 300.0]])
    points, view = scan_surface(part, above, 500, np.random.default_rng(0))
    assert np.allclose(points[:, 2], part.bounds[1, 2])
    assert view is not None
    assert (view == 0).all()
    assert measure_seen_share(part, part, above) == pytest.approx(70 * 50 / part.area, abs=0.01)
    assert measure_seen_share(part, part, place_scanners(part, 8, np.random.default_rng(1))) > 0.99


def test_a_surface_behind_another_is_not_seen() -> None:
    part = make_named_part("cuboid")
    roof = Mesh(np.array([[-90, -90, 40], [90, -90, 40], [0, 90, 40.0]]), np.array([[0, 1, 2]]))
    both = Mesh(
        np.concatenate([part.vertices, roof.vertices]), np.concatenate([part.faces, roof.faces + len(part.vertices)])
    )
    above = np.array([[0, 0, 300.0]])
    points, _ = scan_surface(both, above, 500, np.random.default_rng(0))
    assert (points[:, 2] > 39).mean() > 0.8
    assert measure_seen_share(part, both, above) < 0.02


def test_kinds_and_parts_are_chosen_by_their_names() -> None:
    assert {case.kind for case in make_trouble_cases(["lost w", "waviness"])} == {"lost wall", "waviness"}
    assert {case.part for case in make_trouble_cases(parts=["gear"])} == {"gear"}
    assert len(make_trouble_cases(numbers=[3], seeds=[0, 5])) == 2
    with pytest.raises(InputError, match="--kinds: 'lost wlal' is unknown"):
        make_trouble_cases(["lost wlal"])
    with pytest.raises(InputError, match="no case"):
        make_trouble_cases(["lost wall"], ["gear"])


def test_the_table_counts_and_names_the_silent_cases() -> None:
    wall = [case for case in CASES if case.kind == "lost wall"][:3]
    right, said, silent = (case.make_blank_row() | {"seconds": 2.0, "cpu_seconds": 1.5} for case in wall)
    held = {"truth": 10.0, "volume": 10.5, "low": 9.0, "high": None, "levels": ["likely"], "accepted": 1}
    missed = {**held, "low": 11.0, "high": 12.0}
    right |= {"outcome": "right", "unseen": 1, "iou": 0.99, "step_seconds": 0.5, "groups": [held, missed]}
    said |= {"outcome": "said", "reason": "doubtful: 1 damages missed", "cautious": True}
    silent |= {"reason": "1 damages missed", "seen_error": 1.5}
    text = make_trouble_tables([right, said, silent], "damageest evaluate honesty")
    assert "| lost wall | 3 | 1 | 1 | 0 | 1 | 1 | 0 | 1 | 1 of 2 | 2.0 |" in text
    assert f"1 damages missed. `damageest evaluate honesty --case {wall[2].number} --seeds 0 --points 400`" in text
    assert "oubtful, but right if accepted: 1 cases" in text
    assert "right, 2.0 s: IoU 0.990" in format_trouble_row(right)

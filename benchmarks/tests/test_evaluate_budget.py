"""`damageest evaluate budget`: its scenes, its draws, and its table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.budget import PARTS, make_budget_cases, make_budget_table, make_scene

from damageest.registry import Registry


def draw(inside: bool = True, off: float = 0.5, **more: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"error": "", "sites": 1}
    for name in ("volume", "depth"):
        found |= {f"{name}_in": inside, f"{name}_off": off, f"{name}_u": 0.5, f"{name}_width": 0.04}
    return found | more


def test_table_counts_the_truth_inside_and_the_scatter_in_uncertainties() -> None:
    draws = [draw(off=0.5), draw(off=-0.5), draw(inside=False, off=1.5), {"error": "no interval"}]
    rows = [{"part": "block", "seed": 0, "error": "", "draws": draws}]
    line = next(line for line in make_budget_table(rows, "x").splitlines() if line.startswith("| all"))
    cells = [word.strip() for word in line.strip("|").split("|")][1:]
    assert cells[:5] == ["4", "66.7% ± 27.2%", f"{np.std([1, -1, 3]):.2f}", "+1.00", "4.00%"]
    assert cells[-1] == "1"


def test_cases_share_the_draws_and_none_is_drawn_twice() -> None:
    cases = make_budget_cases(list(PARTS), 45, 20, 3, "code")
    assert sum(case.draws for case in cases if case.part == "ring") == 45
    assert len({case.compute_key() for case in cases}) == 15
    spans = [(case.seed, case.draws) for case in cases if case.part == "ring"]
    assert spans == [(3_000_000, 20), (3_000_020, 20), (3_000_040, 5)]


def test_the_truth_of_a_scene_is_that_of_its_tool() -> None:
    scene = make_scene("plate")
    cap = np.pi * 2.5**2 * (7 - 2.5 / 3)  # of a ball of radius 7 that reaches 2.5 deep
    assert scene.volume == pytest.approx(cap, rel=0.01)
    assert scene.depth == pytest.approx(2.5, abs=0.02)


@pytest.mark.slow
def test_a_draw_has_errors_of_all_kinds_and_an_interval() -> None:
    scene = make_scene("plate")
    row = scene.run(np.random.default_rng(0), Registry.discover())
    assert row["error"] == ""
    assert row["volume_in"]
    assert abs(row["volume_off"]) < 3 * row["volume_u"]

from __future__ import annotations

import xml.etree.ElementTree as Xml
from pathlib import Path

import pytest
from damageest_evaluate.plots import draw_plots

from tests.evaluate_rows import MISSED, row


@pytest.mark.slow
def test_what_was_varied_is_drawn_and_the_errors(tmp_path: Path) -> None:
    rows = [
        row(varied={"noise": n, "points": p, "tolerance": t, "size": s}, tolerance=t, size=s, surface_error=0.1 * n)
        for n, p, t, s in [(1, 1000, 0.1, 0.5), (2, 1000, 0.2, 1.0), (2, 4000, 0.1, 1.0)]
    ]
    rows.append(row(varied=rows[0]["varied"], size=0.5, **MISSED))
    made = draw_plots(rows, "mm", tmp_path)
    assert {path.stem for path in made} == {
        "error_by_noise",
        "time_by_points",
        "time_by_tolerance",
        "found_by_depth",
        "errors",
    }
    for path in made:
        if path.suffix == ".png":
            assert path.read_bytes().startswith(b"\x89PNG")
        else:
            assert Xml.parse(path).getroot().tag.endswith("svg")
    before = {path: path.read_bytes() for path in made}
    draw_plots(rows, "mm", tmp_path)
    assert {path: path.read_bytes() for path in made} == before


@pytest.mark.slow
def test_ways_to_compare_are_lines_of_their_own(tmp_path: Path) -> None:
    rows = [
        row(varied={"way": way, "points": p}, seconds=t, surface_error=0.1)
        for way, p, t in [
            ("default", 1000, 1.0),
            ("default", 4000, 2.0),
            ("method=octree enclose.depth=8", 1000, 5.0),
            ("method=octree enclose.depth=9", 1000, 20.0),
        ]
    ]
    made = {path.name: path for path in draw_plots(rows, "mm", tmp_path)}
    assert {"error_by_time.svg", "time_by_points.svg", "errors.svg"} <= set(made)
    # the rival's settings are one line, with one name
    assert made["error_by_time.svg"].read_text().count("<!-- method=octree -->") == 1
    (tmp_path / "one").mkdir()
    alone = {path.name: path for path in draw_plots(rows[:2], "mm", tmp_path / "one")}
    for name in ("error_by_time.svg", "time_by_points.svg"):
        assert made[name].read_bytes() != alone[name].read_bytes()


def test_nothing_varied_and_nothing_found_draws_nothing(tmp_path: Path) -> None:
    assert draw_plots([row(**MISSED)], "mm", tmp_path) == []
    assert [path.stem for path in draw_plots([row()], "mm", tmp_path)] == ["errors", "errors"]

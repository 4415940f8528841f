"""Figures, tables and the summary."""

from __future__ import annotations

import pytest
from damageest_evaluate.figures import (
    collect_axes,
    compute_figures,
    compute_stage_costs,
    group_by,
    group_by_combination,
    lower_confidence_bound,
    make_title,
    summarise,
)
from damageest_evaluate.report import (
    COLUMNS,
    format_columns,
    format_row,
    format_tables,
    make_cells,
    make_combination_cells,
    make_readme_tables,
    make_remarks,
    make_stage_cells,
)

from tests.evaluate_rows import INTACT, MISSED, row


def at(size: float, found: int, missed: int, **varied: float) -> list[dict[str, object]]:
    places = {"size": size, "varied": {"size": size, **varied}}
    return [row(**places) for _ in range(found)] + [row(**places, **MISSED) for _ in range(missed)]


def test_figures_count_right_wrong_and_flagged() -> None:
    rows = [row(), row(flagged=True), row(iou=0.92), row(iou=0.3, pose_error=0.3), row(flagged=True, **MISSED)]
    found = compute_figures([*rows, row(skipped=True, error="no room")])
    assert (found["cases"], found["right"], found["iou"], found["worst"]) == (5, 0.4, 0.92, 0)
    assert (found["wrong"], found["wrong_flagged"], found["right_flagged"]) == (2, 1, 1)
    assert (found["found"], found["missed"], found["pose_lost"]) == (4, 1, 1)
    assert found["volume_error"] == pytest.approx(0.01)
    assert "cases with IoU < 0.9: 2, of these flagged: 1; cases with IoU >= 0.95 but flagged: 1" in make_remarks(rows)


def test_sound_parts_do_not_count_as_damage_found_well() -> None:
    found = compute_figures([row(iou=0.5), row(**INTACT)])
    assert found["iou"] == 0.5
    assert found["right"] == 0.5
    assert compute_figures([row(**INTACT)])["iou"] is None


def test_a_table_has_a_line_for_each_value() -> None:
    rows = at(0.4, 0, 2) + at(0.8, 2, 0)
    assert collect_axes(rows) == {"size": [0.4, 0.8]}
    assert [len(group) for group in group_by(rows, "size").values()] == [2, 2]
    head, first, second = format_columns(make_cells(rows, "size", "mm")).splitlines()
    assert head.startswith("depth, mm")
    assert first.split()[:4] == ["0.4", "2", "0%", "0.000"]
    assert second.split()[:4] == ["0.8", "2", "100%", "0.990"]
    assert len(head) == len(first) == len(second)


def test_the_sentence_names_the_least_depth_from_which_all_are_found() -> None:
    # found by chance at 0.2 does not count where 0.4 is missed
    text = summarise(at(0.2, 3, 0) + at(0.4, 2, 1) + at(0.8, 20, 0) + at(1.6, 19, 1), "mm")
    assert text.startswith("Damage with a depth of 0.8 mm or more was found in at least 95 % of the cases (20 of 20; ")
    assert text.endswith("the true share is above 86 %).")
    assert summarise(at(0.2, 1, 1) + at(0.4, 9, 1), "in") == (
        "Damage of no depth was found in at least 95 % of the cases (9 of 10 at 0.4 in, the deepest)."
    )


def test_the_sentence_goes_through_what_else_was_varied_and_sound_parts() -> None:
    rows = at(0.2, 1, 0, noise=0.1) + at(0.4, 1, 0, noise=0.1) + at(0.2, 0, 1, noise=0.2) + at(0.4, 2, 0, noise=0.2)
    rows += at(0.2, 1, 0, noise=0.3) + at(0.4, 1, 2, noise=0.3)
    assert summarise([*rows, row(**INTACT), row(**INTACT | {"sites": 1, "iou": 0.0})], "mm") == (
        "Damage was found in at least 95 % of the cases: from a depth of 0.2 mm (1 of 1) with noise 0.1; from a depth "
        "of 0.4 mm (2 of 2) with noise 0.2; at no depth (1 of 3 at 0.4 mm, the deepest) with noise 0.3; on 1 of 2 "
        "scans of the intact part, damage was reported."
    )


def test_heads_name_the_unit_or_that_values_are_multiples() -> None:
    assert make_title("noise", [row(varied={"noise": 0.05})], "in") == "noise, in"
    assert make_title("noise", [row(varied={"noise": 2.0})], "in") == "noise, times the default"
    assert make_title("tolerance", [row(varied={"tolerance": 4.0}), row(varied={"tolerance": "auto"})], "mm").endswith(
        "noise"
    )
    assert make_title("method", [row(varied={"method": "auto"})], "mm") == "method"


def test_the_sentence_where_depth_was_not_varied() -> None:
    text = summarise([row(), row(false_sites=1), row(**MISSED)], "mm")
    assert text == "All damage was found in 2 of 3 cases; no false site was reported in 2."
    assert (
        summarise([row(**INTACT)], "mm")
        == "No case had damage; on 0 of 1 scan of the intact part, damage was reported."
    )


def test_how_sure_a_share_is() -> None:
    assert lower_confidence_bound(10, 10) == pytest.approx(0.05**0.1)
    assert lower_confidence_bound(0, 10) == 0


def test_a_case_is_told_with_what_went_wrong() -> None:
    assert format_row(row(kinds=["pit"])) == "cuboid 5: pit: IoU 0.990, 2.0 s"
    assert format_row(row(error="align: lost", **MISSED)).endswith("\n  align: lost")
    assert format_row(row(skipped=True, error="no room")) == "cuboid 5: skipped: no room"


def test_cost_is_told_in_passes_of_libigl_and_by_stage() -> None:
    rows = [row(), row(cpu_seconds=1.0, stage_seconds={"align": 3.0}, stage_megabytes={"align": 300}), row(**MISSED)]
    rows.append(row(error="crashed", cpu_seconds=None, stage_seconds={}))
    assert compute_figures(rows)["libigl"] == 6
    assert compute_stage_costs(rows) == {"align": (1.0, 300), "enclose": (0.5, 90)}
    assert make_stage_cells(rows)[1] == ["align", "1.00", "300"]
    assert "1.0 s to start Python and import the libraries" in make_remarks(rows)


def test_ways_to_compare_get_a_line_for_each_combination() -> None:
    rows = [row(varied={"points": n, "way": way}) for n in (1000, 2000) for way in ("default", "method=octree")]
    assert [len(group) for group in group_by_combination(rows).values()] == [1] * 4
    head, *body = make_combination_cells(rows, "mm")
    assert head[:2] == ["points", "way"]
    assert [line[:2] for line in body] == [[n, w] for n in ("1000", "2000") for w in ("default", "method=octree")]
    assert "method=octree" in format_tables(rows, ["points", "way"], "mm")
    text = make_readme_tables(rows, ["points", "way"], "mm", "damageest evaluate")
    assert text.startswith("| points | way | cases |")
    assert text.splitlines()[1] == "| --- | --- |" + " ---: |" * len(COLUMNS)

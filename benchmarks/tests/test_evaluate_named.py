"""Random damages with every named background: what counts as right, and what a refusal has to offer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.named import NamedCase, describe_row, judge_cell, make_background, make_named_table
from damageest_benchmarks.parts import PARTS


def row(**cells: tuple[float, str]) -> dict[str, Any]:
    told = {
        name: {"iou": iou, "volume": iou, "refused": refused, "seconds": 2.0 if name == "offset" else 3.0}
        for name, (iou, refused) in cells.items()
    }
    return NamedCase(3).make_blank_row() | {"default_iou": 0.98, "cells": told}


def test_a_result_near_the_default_is_right() -> None:
    assert judge_cell(row(bbox=(0.96, "")), "bbox") == "right"
    assert judge_cell(row(bbox=(0.94, "")), "bbox") == "wrong"


def test_a_refusal_counts_only_with_a_remedy_that_works() -> None:
    refused = row(bbox=(0.0, "enclose: divide: does not divide try: method: implicit"), capsule=(0.0, "no remedy"))
    assert judge_cell(refused, "bbox") == "refused"
    assert judge_cell(refused, "capsule") == "wrong"


def test_the_table_has_a_line_for_each_background() -> None:
    head, *lines = make_named_table([row(offset=(0.98, ""), bbox=(0.5, "")), row(offset=(0.97, ""), bbox=(0.98, ""))])
    assert lines == [["offset", "2", "2", "0", "0", "0.9750", "1.00"], ["bbox", "2", "1", "0", "1", "0.7400", "1.50"]]
    assert len(head) == len(lines[0])


def test_a_draw_in_a_line_names_what_is_not_right() -> None:
    assert describe_row(row(bbox=(0.98, ""), capsule=(0.5, ""))).endswith("bbox 0.980, capsule 0.500 WRONG")


def test_a_build_volume_is_round_the_part() -> None:
    part = PARTS["lever"]()
    made = make_background("build_volume", part)
    corner, size = np.array(made["corner"]), np.array(made["size"])
    assert (corner < part.bounds[0]).all()
    assert (corner + size > part.bounds[1]).all()


@pytest.mark.slow
def test_a_pit_comes_out_with_two_backgrounds() -> None:
    found = NamedCase(1, ("offset", "bbox")).run()
    assert [judge_cell(found, name) for name in ("offset", "bbox")] == ["right", "right"]
    assert found["default_iou"] > 0.97

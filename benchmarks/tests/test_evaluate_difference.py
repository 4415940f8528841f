"""`damageest evaluate difference`: its pairs of scans, and its table."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.differences import (
    BALL,
    EARLY,
    LATE,
    PAIRS,
    PARTS,
    Pair,
    draw_pair,
    make_difference_cases,
    make_difference_table,
)


def test_a_pair_has_a_known_loss_and_overlaps_in_part() -> None:
    pair = Pair("", "block", (BALL, 5, (20, 15, 10)), (BALL, 3, (-4, -8, 10)), before=EARLY, after=LATE)
    drawn = draw_pair(pair, 0)
    assert drawn.lost == pytest.approx(np.pi * 5**3 / 6, rel=0.01)  # an eighth of a ball
    assert drawn.gained == pytest.approx(2 * np.pi * 3**3 / 3, rel=0.01)  # half of one
    assert 0.4 < drawn.overlap < 0.9
    assert np.array_equal(drawn.after, draw_pair(pair, 0).after)


def test_the_table_counts_what_was_right_said_and_silent() -> None:
    cases = make_difference_cases([0, 1], ["wrong part"], "code")
    assert len(cases) == 4
    assert len({case.compute_key() for case in cases}) == 4
    told = [("right", [60.0, 70.0]), ("said", None), ("silent", [0.0, 1.0]), ("said", [0.0, None])]
    rows = [case.make_blank_row() | {"outcome": o, "interval": i} for case, (o, i) in zip(cases, told, strict=True)]
    text = make_difference_table(rows, "x")
    assert "1 right, 2 wrong or refused and said, 1 wrong and silent." in text
    assert "0.0 (0.0 to open)" in text


def test_at_least_twenty_pairs_on_all_parts() -> None:
    assert len(PAIRS) >= 20
    assert {pair.part for pair in PAIRS} == set(PARTS)

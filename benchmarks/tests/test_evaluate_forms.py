"""The table of forms."""

from __future__ import annotations

import pytest
from damageest_benchmarks.forms import FormCase, make_form_cases, run_case


def test_every_kind_is_there_on_at_least_six_parts() -> None:
    cases = make_form_cases()
    assert {case.kind for case in cases} == {"scale", "bend", "twist"}
    assert len({case.part for case in cases}) >= 6


@pytest.mark.slow
def test_a_row_says_what_was_found() -> None:
    cells = [cell.strip() for cell in run_case(FormCase("plate", "twist", 2.0), False).split("|")]
    assert cells[3] == "deformed"
    assert cells[4].startswith("twist")
    assert abs(float(cells[5].removesuffix("%"))) < 20

"""`damageest evaluate adapt`."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from damageest_benchmarks.adapting.drift import fit_by_drift
from damageest_benchmarks.adapting.plain import fit_plainly
from damageest_benchmarks.adapting.report import make_adapting_table
from damageest_benchmarks.adapting.suite import GROUPS, SHAPES, USES, make_adapting_cases
from damageest_benchmarks.parts import PARTS
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError, InputError
from damageest.geometry.distance import signed_distance
from damageest.geometry.sampling import sample_by_area
from damageest.stages.scan.deformation import Deformation, deform
from tests import damaged_box
from tests.evaluate_calls import evaluate


@pytest.mark.slow
def test_the_suite_has_enough_of_everything() -> None:
    cases = [case for case in make_adapting_cases([], "", 1000, "") if case.use == "auto"]
    count = Counter(case.group for case in cases)
    assert set(count) == set(GROUPS)
    assert count["damaged"] >= 80
    assert count["whole"] == count["worn"] == 20
    damaged = [case for case in cases if case.group == "damaged"]
    assert {case.part for case in damaged} == set(SHAPES)
    assert {len(case.losses) for case in damaged} == {1, 2, 3}
    keys = [case.adapted_by(use).compute_key() for case in cases for use in USES]
    assert len(set(keys)) == len(keys)


@pytest.mark.slow
def test_the_plain_fit_follows_a_bend() -> None:
    part = damaged_box.box()
    points = deform(sample_by_area(part, 4000, np.random.default_rng(1))[0], Deformation(bend=1.0), part)
    assert np.abs(signed_distance(points, part)[0]).max() > 0.5
    assert np.abs(signed_distance(points, fit_plainly(part, points))[0]).max() < 0.05


@pytest.mark.slow
def test_the_table_counts_what_is_right() -> None:
    case = make_adapting_cases(["whole"], "", 1000, "")[0]
    row = case.make_blank_row()
    good = row | {"inside": True, "seconds": 2.0}
    wrong = row | {"inside": True, "verdicts": ["likely"], "seconds": 4.0}
    (line,) = [text for text in make_adapting_table([good, wrong]).splitlines() if text.startswith("| whole")]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[2] == "2 of 2"
    assert cells[7:] == ["1 of 2", "1", "3"]


@pytest.mark.parametrize(("words", "said"), [(["--groups", "broken"], "lost end"), (["--use", "smoth"], "plain")])
def test_a_wrong_name_is_refused(words: list[str], said: str) -> None:
    with pytest.raises(DamageestError) as caught:
        CliRunner().invoke(app, ["evaluate", "adapt", *words], catch_exceptions=False)
    assert caught.value.exit_status == 2
    assert said in str(caught.value)


@pytest.mark.slow
def test_a_case_is_run_once(tmp_path: Path) -> None:
    words = ["adapt", "--groups", "whole", "--only", "block", "--use", "auto", "--every", "9", "--points", "8000"]
    first, second = (evaluate(*words, "--out", tmp_path) for _ in range(2))
    assert first.returncode == second.returncode == 0, first.stderr
    assert "whole" in first.stdout
    assert first.stdout == second.stdout
    assert len((tmp_path / "adapt.jsonl").read_text().splitlines()) == 1


def test_drift_without_its_library_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pycpd", None)
    part = PARTS["cuboid"]()
    with pytest.raises(InputError, match=r"pip install pycpd"):
        fit_by_drift(part, part.vertices)

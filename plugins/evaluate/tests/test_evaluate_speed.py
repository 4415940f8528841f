"""`damageest evaluate speed`."""

from __future__ import annotations

from pathlib import Path

import pytest
from damageest_evaluate.readme import make_marks
from damageest_evaluate.speed import KINDS, make_speed_cases
from evaluate_calls import evaluate
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError, InputError
from damageest.registry import Registry


@pytest.mark.slow
def test_a_case_is_measured_against_one_distance_pass(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    begin, end = make_marks("speed")
    page.write_text(f"{begin}\n{end}\n")
    done = evaluate("speed", "--kinds", "small scan", "--points", "2e4", "--set", "report=none", "--write", page)
    assert done.returncode == 0, done.stderr
    (line,) = [text for text in page.read_text().splitlines() if text.startswith("| small scan")]
    _, points, iou, _, processor, _, libigl, a_million, ratio, *_ = (
        word.strip() for word in line.strip("|").split("|")
    )
    assert points == "20000"
    assert float(iou) > 0.8
    assert float(a_million) == pytest.approx(50 * float(libigl), rel=0.3)
    assert float(ratio) == pytest.approx(float(processor) / float(libigl), rel=0.3)
    assert "enclose" in line
    assert "`damageest evaluate speed" in page.read_text()


@pytest.mark.parametrize(("words", "said"), [(["--kinds", "small chap"], "small chip"), (["--points", "many"], "1e6")])
def test_a_wrong_value_is_refused(words: list[str], said: str) -> None:
    with pytest.raises(DamageestError) as caught:
        CliRunner().invoke(app, ["evaluate", "speed", *words], catch_exceptions=False)
    assert caught.value.exit_status == 2
    assert said in str(caught.value)


@pytest.mark.slow
def test_cases_have_the_damage_of_their_kind(registry: Registry) -> None:
    cases = make_speed_cases(list(KINDS), 0, [], registry)
    assert [len(case.tools) for case in cases] == [len(kind.tools) for kind in KINDS.values()]
    assert len({case.compute_key() for case in cases}) == len(KINDS)
    with pytest.raises(InputError, match="no 'chip'"):
        make_speed_cases(["chip"], 0, [], registry)

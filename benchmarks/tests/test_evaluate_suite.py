"""`damageest evaluate suite`, and its tables in the documentation."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from damageest_benchmarks import suite
from damageest_benchmarks.parts import PARTS
from damageest_benchmarks.readme import make_marks
from damageest_evaluate.damages import KINDS
from damageest_evaluate.report import COLUMNS
from damageest_evaluate.variants import VariationRequest
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError, InputError
from damageest.job import load
from damageest.registry import Registry
from damageest.stages.part import ReadPart
from tests.evaluate_calls import evaluate, rows_of, timeless
from tests.needs import needs_plugin

PAGE = Path(__file__).parents[2] / "benchmarks" / "results" / "damages.md"
BEGIN, END = make_marks("suite")


def tables(text: str, name: str = "suite") -> list[list[list[str]]]:
    """The Markdown tables between the marks, as lines of words."""
    begin, end = make_marks(name)
    lines = text.partition(begin)[2].partition(end)[0].splitlines()
    found: list[list[list[str]]] = []
    for before, line in zip(["", *lines], lines, strict=False):
        if line.startswith("|"):
            found += [] if before.startswith("|") else [[]]
            found[-1].append([word.strip() for word in line.strip("|").split("|")])
    return found


def check(table: list[list[str]], names: set[str]) -> None:
    """A table of the suite: its head, and in each line a name and figures."""
    head, rule, *body = table
    assert head[1:] == [title for title, _ in COLUMNS.values()]
    assert rule == ["---", *["---:"] * len(COLUMNS)]
    assert len(body) > 0
    for line in body:
        assert line[0] in names
        assert len(line) == len(head)
        assert all(re.fullmatch(r"\d+(\.\d+)?(e[+-]\d+)?%?|–", word) for word in line[1:])


@pytest.mark.slow
def test_two_methods_on_a_part_twice_over_and_the_table_in_a_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    words = ["--cases", 1, "--parts", "cuboid", "--pose", "identity", "--points", 20_000, "--size", 5]
    words += ["--vary", "method=implicit,surface", "--no-plots"]
    done = evaluate("suite", *words, "--out", tmp_path / "a", "--write", page)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert text.startswith(f"before\n{BEGIN}\n")
    assert text.endswith(f"{END}\nafter\n")
    (methods,) = tables(text)  # of one part there is no table by part
    check(methods, {"implicit", "surface", "all"})
    assert methods[0][0] == "method"
    assert re.search(r"`damageest evaluate suite --cases 1 .* --no-plots`\. Measured \d{4}-\d\d-\d\d: Python", text)
    assert done.stdout.splitlines()[-1].startswith("Damage was found in at least 95 % of the cases: ")

    assert evaluate("suite", *words, "--jobs", 1, "--out", tmp_path / "b").returncode == 0
    a, b = rows_of(tmp_path / "a"), rows_of(tmp_path / "b")
    assert {key: timeless(row) for key, row in a.items()} == {key: timeless(row) for key, row in b.items()}
    assert sorted(row["methods"] for row in a.values()) == [["implicit"], ["surface"]]
    assert all(row["found"] == 1 and row["iou"] > 0.9 for row in a.values())


def test_cases_go_through_parts_and_kinds_in_turn_and_their_seeds_differ(registry: Registry) -> None:
    cases = suite.make_cases(40, 2, list(PARTS), "random", VariationRequest(tolerance="4"), registry)
    assert [case.part for case in cases] == [list(PARTS)[k % 13] for k in range(40)]
    assert {case.first for case in cases} == set(KINDS)
    # the second round has other damages on the parts
    assert all(a.first != b.first for a, b in zip(cases[:13], cases[13:26], strict=True))
    assert [case.seed for case in cases] == list(range(2000, 2040))
    assert all(case.tolerance == pytest.approx(4 * case.scanner["noise"]) for case in cases)
    assert len({case.compute_key() for case in cases}) == 40


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--parts", "cubiod"], "there is no part 'cubiod' (did you mean 'cuboid'?)"),
        (["--method", "implizit"], "did you mean 'implicit'?"),
        (["--pose", "unknown"], "give random or identity"),
        (["--cases", "0"], "at least 1 is needed"),
    ],
)
def test_faults_are_named(words: list[str], said: str) -> None:
    with pytest.raises(DamageestError) as caught:
        CliRunner().invoke(app, ["evaluate", "suite", *words], catch_exceptions=False)
    assert caught.value.exit_status == 2
    assert said in str(caught.value)


def test_a_page_without_marks_is_refused_before_anything_runs(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("no marks\n")
    done = CliRunner().invoke(app, ["evaluate", "suite", "--write", str(page)])
    assert isinstance(done.exception, InputError)
    assert done.exception.exit_status == 2
    assert "suite: begin" in str(done.exception)
    assert "[1/" not in done.stderr


def test_the_table_in_the_docs_is_of_this_suite(registry: Registry) -> None:
    found = tables(PAGE.read_text())
    assert found, "the table is missing: damageest evaluate suite --write benchmarks/results/damages.md"
    assert found[0][0][0] == "part"
    check(found[0], {*PARTS, "all"})
    assert {line[0] for line in found[0][2:]} == {*PARTS, "all"}
    for table in found[1:]:
        axis = table[0][0]
        known = {item.name for item in registry.of(axis)} or {"auto", "implicit", "surface", "octree"}
        names = known if axis == "method" or registry.of(axis) else {line[0] for line in table[2:]}
        check(table, names)


@pytest.mark.parametrize("name", ["points", "fineness", pytest.param("rivals", marks=needs_plugin("open3d")), "dense"])
def test_the_tables_of_cost_in_the_docs_name_what_there_is(name: str, registry: Registry) -> None:
    (table,) = tables(PAGE.read_text(), name)
    head, _, *body = table
    axes = head[: -len(COLUMNS)]
    assert axes
    assert set(axes) <= {"points", "tolerance, times the noise", "tolerance, mm", "way", "part"}
    assert head[len(axes) :] == [title for title, _ in COLUMNS.values()]
    assert len(body) > 1
    for line in body:
        assert all(re.fullmatch(r"\d+(\.\d+)?(e[+-]\d+)?%?|–", word) for word in line[len(axes) :])
        if "way" in axes and (way := line[axes.index("way")]) != "default":
            part, scan = PARTS["cuboid"](), {"use": "simulate", "damage": []}
            load({"version": 1, "scan": scan}, registry, way.split(), {ReadPart: part})


def test_an_unknown_part_is_an_error_of_its_own(registry: Registry) -> None:
    with pytest.raises(InputError, match="there are: block"):
        suite.make_cases(1, 0, ["nothing"], "random", VariationRequest(), registry)


def test_rows_of_other_code_are_not_gone_on_from(registry: Registry) -> None:
    other = replace(registry, providers=registry.providers[:1])
    a, b = (suite.make_cases(1, 0, ["cuboid"], "random", VariationRequest(), code)[0] for code in (registry, other))
    assert a.compute_key() != b.compute_key()
    assert replace(a, source=b.source).compute_key() == b.compute_key()

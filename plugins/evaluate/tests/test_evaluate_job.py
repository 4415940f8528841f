"""`damageest evaluate job`, on a small box."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_evaluate import case as case_module
from damageest_evaluate.job import plan_study
from damageest_evaluate.variants import VariationRequest
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError
from damageest.registry import Registry
from tests import damaged_box
from tests.evaluate_calls import evaluate, rows_of, timeless

SIMULATED = damaged_box.JOB.replace(
    "scan: scan.ply", "scan: {use: simulate, points: 20000, noise: 0.04, outliers: 0.01}"
)


@pytest.mark.slow
def test_depths_found_and_not_found_are_told_kept_and_gone_on_from(tmp_path: Path) -> None:
    job, out = damaged_box.write(tmp_path, SIMULATED), tmp_path / "out"
    words = ("job", job, "--seeds", 1, "--size", "0,4", "--noise", "0.5,1", "--out", out)
    done = evaluate(*words)
    assert done.returncode == 0, done.stderr
    first = rows_of(out)
    places = sorted((row["size"], row["noise"]) for row in first.values())
    assert places == [(size, noise) for size in (0, 4) for noise in (0.02, 0.04)]
    for row in first.values():
        assert not row["error"]
        assert 50 < row["megabytes"] < 5000
        assert (row["found"], row["missed"], row["false_sites"]) == (int(row["size"] > 0), 0, 0)
        if row["size"]:
            assert row["iou"] > 0.9
            assert row["distance_median"] < row["distance_95"] < row["distance_max"] < 2.1
            assert row["depth"] == pytest.approx(4, rel=0.05)
            assert {"segment", "enclose"} < set(row["stage_seconds"])
    head, *body = [text.split() for text in done.stdout.splitlines() if text.startswith(("depth", "0", "4"))][:3]
    assert head[:5] == ["depth,", "mm", "cases", "IoU", ">="]
    assert [text[:2] for text in body] == [["0", "2"], ["4", "2"]]
    last = done.stdout.splitlines()[-1]
    assert last.startswith(
        "Damage was found in at least 95 % of the cases: from a depth of 4 mm (1 of 1) with noise 0.02; "
    )
    assert last.endswith("; on 0 of 2 scans of the intact part, damage was reported.")

    summary = json.loads((out / "summary.json").read_text())
    assert summary["sentence"] == last
    assert [group["value"] for group in summary["by"]["size"]] == [0, 4]
    with (out / "cases.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == 4
    drawn = {path.name for path in out.iterdir() if path.suffix in (".png", ".svg")}
    assert drawn == {f"{n}.{s}" for n in ("error_by_noise", "found_by_depth", "errors") for s in ("png", "svg")}

    # a run that was killed: rows of three cases, and the beginning of one
    lines = (out / "cases.jsonl").read_text().splitlines(keepends=True)
    lost = next(k for k, text in enumerate(lines) if json.loads(text)["size"])
    kept = lines[:lost] + lines[lost + 1 :]
    (out / "cases.jsonl").write_text("".join(kept) + lines[lost][:50])
    evaluate(*words)
    again = (out / "cases.jsonl").read_text().splitlines(keepends=True)
    assert again[:3] == kept, "was run again"
    # from the same seed came the same numbers
    assert again[3] != lines[lost]
    assert timeless(json.loads(again[3])) == timeless(json.loads(lines[lost]))


@pytest.mark.slow
def test_cases_that_fail_or_do_not_fit_stop_nothing(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, SIMULATED)
    # a build volume smaller than the part is refused; no damage is deeper than the box is wide
    way = "background=bbox,{use: build_volume, size: [1, 1, 1]}"
    done = evaluate("job", job, "--seeds", 1, "--size", "4,25", "--vary", way, "--out", tmp_path, "--no-plots")
    assert done.returncode == 0, done.stderr
    rows = {(row["size"], row["varied"]["background"][:4]): row for row in rows_of(tmp_path).values()}
    assert len(rows) == 4
    assert rows[4, "bbox"]["iou"] > 0.9
    refused = rows[4, "{'us"]
    assert refused["error"].startswith("background: build_volume")
    assert (refused["flagged"], refused["found"], refused["missed"]) == (True, 0, 1)
    assert rows[25, "bbox"]["skipped"]
    assert "skipped cases: 2; the first: no damage with a depth of 25 fits the part" in done.stdout


@pytest.mark.slow
def test_a_case_that_takes_too_long_is_a_row_with_an_error(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, SIMULATED.replace("20000", "2000"), 2000)
    words = ["evaluate", "job", str(job), "--seeds", "1", "--size", "4", "--timeout", "0.01"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "was ended: not finished after 0.01 s" in done.stderr
    assert "Damage of no depth was found in at least 95 % of the cases (0 of 1 at 4 mm, the deepest)" in done.stdout


@pytest.fixture
def real(tmp_path: Path) -> Path:
    return damaged_box.write(tmp_path)


@pytest.mark.slow
def test_the_virtual_scanner_is_like_the_jobs_scan(real: Path, tmp_path: Path, registry: Registry) -> None:
    found = plan_study(real, VariationRequest(), 3, registry, tmp_path)
    case = found.cases[-1]
    assert case.scanner["noise"] == pytest.approx(0.04, rel=0.1)
    assert case.scanner["points"] == pytest.approx(20_000, rel=0.1)
    assert case.scanner["pose"] == "identity"
    # depths of 0, 2, 4, 8 and 16 tolerances; the last, 3.2, within a tenth of the part
    assert [c.size for c in found.cases[:5]] == pytest.approx([0, 0.4, 0.8, 1.6, 3.2])
    assert len({c.compute_key() for c in found.cases}) == len(found.cases) == 15
    part = case.load_part()
    a, b = case_module.simulate_scan(case, part)[0], case_module.simulate_scan(case, part)[0]
    assert a.points.tobytes() == b.points.tobytes()
    assert a.truth is not None
    assert np.array_equal(a.truth.T_part_scan, np.eye(4))


@pytest.fixture
def sparse(tmp_path: Path) -> Path:
    return damaged_box.write(tmp_path, points=2000)


@pytest.mark.slow
def test_the_key_does_not_depend_on_where_the_files_lie(sparse: Path, tmp_path: Path, registry: Registry) -> None:
    other = damaged_box.write(tmp_path / "moved", points=2000)
    (tmp_path / "place").mkdir()
    here = plan_study(sparse, VariationRequest(), 1, registry, tmp_path).cases
    there = plan_study(other, VariationRequest(), 1, registry, tmp_path / "place").cases
    assert [case.compute_key() for case in here] == [case.compute_key() for case in there]
    other.write_text(damaged_box.JOB + "allowance: none\n")
    assert (
        plan_study(other, VariationRequest(), 1, registry, tmp_path / "place").cases[0].compute_key()
        != here[0].compute_key()
    )


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"vary": ["clutser.eps=1,2"]}, "did you mean 'cluster'?"),
        ({"vary": ["cluster.neighbors=5,10"]}, "did you mean 'neighbours'?"),
        ({"vary": ["cluster.use=dbscan,dbscam"]}, "did you mean 'dbscan'?"),
        ({"vary": ["scan.densty=0.1,0.2"]}, "did you mean 'density'?"),
        ({"size": "-1"}, "--size: '-1' is not a length"),
    ],
)
def test_faults_are_named_before_anything_runs(
    sparse: Path, tmp_path: Path, registry: Registry, wanted: dict[str, Any], said: str
) -> None:
    with pytest.raises(DamageestError) as caught:
        plan_study(sparse, VariationRequest(**wanted), 1, registry, tmp_path)
    assert said in str(caught.value)
    assert caught.value.exit_status == 2


@pytest.mark.slow
def test_a_jobs_cut_back_is_no_error_of_its_damage(tmp_path: Path) -> None:
    stock = "allowance: {use: milling, outer: 1, inner: 1}\n"
    ious = []
    simulated = SIMULATED.replace("20000", "6000")
    for text in (simulated, simulated + stock):
        path = damaged_box.write(tmp_path, text, 2000)
        (case,) = plan_study(path, VariationRequest(size="4"), 1, Registry.discover(), tmp_path).cases
        ious.append(case_module.run_case(case)["iou"])
    assert ious[0] == ious[1] > 0.9

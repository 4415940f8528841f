"""`damageest evaluate reported`: what users of other tools report in public."""

from __future__ import annotations

import re

import numpy as np
import pytest
from damageest_benchmarks.reported.bench import refine, take
from damageest_benchmarks.reported.case import (
    ReportedCase,
    describe_reported_row,
    is_good,
    make_reported_cases,
    make_reported_table,
    summarise,
)
from damageest_benchmarks.reported.registry import REPORTS, Reported
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import InputError
from damageest.geometry.solids import to_manifold


def test_each_report_has_an_address_of_its_own() -> None:
    addresses = [report.address for report in REPORTS]
    assert len(REPORTS) >= 50
    assert len(set(addresses)) == len({report.kind for report in REPORTS}) == len(REPORTS)
    assert all(re.fullmatch(r"[\w.-]+\.[a-z]+/[\w./-]+", address) for address in addresses)


@pytest.mark.variants(6, slow=50)
@pytest.mark.parametrize("report", REPORTS[10:] + REPORTS[:10], ids=lambda report: report.kind)
def test_a_report_has_a_closed_part_a_loss_and_points(report: Reported) -> None:
    draw = report.make()
    assert 0 < to_manifold(draw.part).volume() == pytest.approx(draw.part.volume, rel=1e-6)
    assert draw.damage is not None
    assert 1e-4 < draw.damage.volume / draw.part.volume < 0.8
    assert np.isfinite(draw.scan.points).all()
    assert len(draw.scan.points) > 5000


def test_equal_calls_give_equal_scans() -> None:
    first, second = REPORTS[7].make(), REPORTS[7].make()
    assert np.array_equal(first.scan.points, second.scan.points)


def test_a_mesh_scan_has_short_edges_on_the_same_surface() -> None:
    bench = take("cuboid", 1)
    fine = refine(bench.left, 5.0)
    assert fine.area == pytest.approx(bench.left.area)
    assert np.linalg.norm(fine.triangles[:, 0] - fine.triangles[:, 1], axis=1).max() < 10


def test_a_run_is_good_where_it_says_what_it_should() -> None:
    blank = ReportedCase(REPORTS[0].address).make_blank_row()
    outcomes = {"right": ("right", "inside"), "said": ("said",), "either": ("right", "inside", "said")}
    for wanted, good in outcomes.items():
        for outcome in ("right", "inside", "said", "silent"):
            assert is_good(blank | {"wanted": wanted, "outcome": outcome}) == (outcome in good)
    silent = blank | {"accepted": 1, "volume": 12.0, "low": 11.0, "high": None, "true_volume": 8.0}
    assert describe_reported_row(silent).startswith(f"{REPORTS[0].kind}: SILENT (either wanted); 12 (11 to ∞) for 8")
    refused = blank | {"outcome": "said", "refused": True, "error": "too | noisy"}
    table = make_reported_table([silent, refused])
    assert {len(line) for line in table} == {8}
    assert table[1][3] == "**silent**"
    assert table[2][6] == "too / noisy"
    assert summarise([silent, refused]) == "1 of 2 as wanted, 1 wrong and silent."


def test_words_choose_reports() -> None:
    assert [case.report.kind for case in make_reported_cases(["mrpt", "MRPT"], "s")] == ["zeros for no answer"]
    assert len({case.compute_key() for case in make_reported_cases((), "s")}) == len(REPORTS)
    with pytest.raises(InputError, match="no report has one of the words nothing"):
        CliRunner().invoke(app, ["evaluate", "reported", "nothing"], catch_exceptions=False)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["zeros for no answer", "strict outlier filter"])
def test_a_run_of_a_report(kind: str) -> None:
    row = make_reported_cases([kind], "source")[0].run()
    assert is_good(row)
    assert row["low"] <= row["true_volume"] <= row["high"]

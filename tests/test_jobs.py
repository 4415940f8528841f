"""Every example job: the result is consistent, and right if the truth is known. All that runs them is slow."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import damageest
from damageest.artefacts import Deposit, Solid
from damageest.job import yamlfile
from tests.needs import needs_plugin

JOBS = Path(__file__).parents[1] / "jobs"
SITES = {
    "block_wedge": 1,
    "block_certified": 1,
    "named_stages": 1,
    "gear_teeth": 4,
    "gear_exact": 3,
    "cylinder_two_sides": 2,
    "half_torus": 1,
    "four_sites": 4,
    "worn_shaft": 1,
    "block_path": 1,
    "block_kuka": 1,
    "two_months": 1,
}
STOCK = {"stock_uniform": 0.8, "stock_flanks": 0.3, "worn_bore": 0.5}
"""Millimetres of stock that the jobs ask for; each has as many sites as `DEPOSITS` says."""
DEPOSITS = {"stock_uniform": 1, "stock_flanks": 2, "worn_bore": 2}
FLANKS, BORE = set(range(0, 75, 2)), {5}
WEDGE, CHIP = 5929.0, 65.1
"""Volume in mm3 of the wedge that jobs/make_inputs.py cuts off the block before it scans it, and of the chip that
broke off the block between two scans."""


def mark_job(name: str) -> Any:
    """The name of a job; its tests are skipped where its part needs a plugin that cannot be used."""
    part = yamlfile.read(JOBS / f"{name}.yaml")[0]["part"]
    suffix = Path(part["path"] if isinstance(part, dict) else part).suffix
    return pytest.param(name, marks=[needs_plugin("cadquery")] if suffix == ".step" else [])


def test_every_job_is_listed() -> None:
    assert {path.stem for path in JOBS.glob("*.yaml")} == {*SITES, *STOCK, "bent_blade"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [mark_job(name) for name in SITES])
def test_example(name: str) -> None:
    # its first site is doubted: at 14 % of its points a thin wall is left, which looks like two views that do not fit
    result = damageest.run(JOBS / f"{name}.yaml", settings=["accept=all"] if name == "gear_exact" else [])
    assert result.status == "ok"
    assert len(result.sites) == SITES[name]
    assert all(site.evidence.consistent for site in result.sites)
    assert isinstance(result.damage, Solid)
    assert result.undamaged_volume + result.damage_volume == pytest.approx(result.part.volume, rel=1e-6)
    if result.truth is not None:
        assert result.truth[1] >= 0.97
    else:
        true, error = (CHIP, 0.03) if name == "two_months" else (WEDGE, 0.01)
        assert result.damage_volume == pytest.approx(true, rel=error)


@pytest.mark.slow
@pytest.mark.parametrize("name", [mark_job(name) for name in STOCK])
def test_example_with_stock(name: str) -> None:
    # its first site is doubted: at 14 % of its points a thin wall is left, which looks like two views that do not fit
    result = damageest.run(JOBS / f"{name}.yaml", settings=["accept=all"] if name == "gear_exact" else [])
    assert result.status == "ok"
    assert len(result.sites) == DEPOSITS[name]
    touched = {"stock_uniform": set(), "stock_flanks": FLANKS, "worn_bore": BORE}[name]
    for site in result.sites:
        deposit = site.deposit
        assert isinstance(deposit, Deposit)
        assert deposit.thickness is not None
        assert STOCK[name] <= deposit.thickness[0] <= deposit.thickness[2] <= STOCK[name] + result.tolerance
        assert deposit.volume == pytest.approx(site.damage.volume + deposit.stock_volume, rel=1e-3)
        assert (deposit.cut_back_volume > 0) == (name == "worn_bore")
        assert set(deposit.touched) <= touched
    assert result.undamaged_volume + result.damage_volume == pytest.approx(result.part.volume, rel=1e-6)
    if result.truth is not None:
        assert result.truth[1] >= 0.97


@pytest.mark.slow
def test_the_losses_of_a_bent_blade_are_found() -> None:
    result = damageest.run(JOBS / "bent_blade.yaml")
    assert result.adapted is not None
    assert result.adapted.amount > 10 * result.tolerance
    assert result.fit is not None
    assert result.fit.model == "ok"
    assert len(result.sites) == 2
    assert all(site.accepted for site in result.sites)
    assert result.truth is not None
    assert result.truth[1] >= 0.96
    true, (low, high) = result.truth[0], result.volume_95 or (0.0, 0.0)
    assert low <= true <= high


@pytest.mark.slow
def test_a_blade_that_is_bent_a_little_is_named_and_its_chip_is_found() -> None:
    deform, damage = {"bend": 0.16}, [{"tool": "blob", "centre": [10, 6, 79], "radius": 7, "roughness": 0.3, "seed": 4}]
    result = damageest.run(
        JOBS / "bent_blade.yaml",
        settings=["adapt=none", f"scan.deform={json.dumps(deform)}", f"scan.damage={json.dumps(damage)}"],
    )
    assert result.fit is not None
    assert result.fit.model == "deformed"
    assert result.fit.deformation[0][0] == "bend"
    assert result.fit.amount == pytest.approx(0.16, rel=0.2)
    assert any(site.accepted for site in result.sites)
    assert result.truth is not None
    assert result.truth[1] >= 0.93

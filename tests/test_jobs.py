"""Every example job, as shipped: sound, watertight, and right where the truth is known."""

from __future__ import annotations

from pathlib import Path

import pytest

import damageest
from damageest.artefacts import Solid

JOBS = Path(__file__).parents[1] / "jobs"
SITES = {"block_wedge": 1, "gear_teeth": 4, "cylinder_two_sides": 2, "half_torus": 1, "four_sites": 4}
WEDGE = 5929.0
"""Volume in mm3 of the wedge that jobs/make_inputs.py cuts off the block before it scans it."""


def test_every_job_is_listed() -> None:
    assert {path.stem for path in JOBS.glob("*.yaml")} == set(SITES)


@pytest.mark.parametrize("name", SITES)
def test_example(name: str) -> None:
    result = damageest.run(JOBS / f"{name}.yaml")
    assert result.status == "ok"
    assert len(result.sites) == SITES[name]
    assert all(site.evidence.consistent for site in result.sites)
    assert isinstance(result.damage, Solid)
    assert result.undamaged_volume + result.damage_volume == pytest.approx(result.part.volume, rel=1e-6)
    if result.truth is not None:
        assert result.truth[1] >= 0.97
    else:
        assert result.damage_volume == pytest.approx(WEDGE, rel=0.01)

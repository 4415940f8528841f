"""Real files, from the folder in the variable DAMAGEEST_REAL_DATA; skipped if it is not set."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import damageest
from damageest.errors import InputError

DATA = Path(os.environ.get("DAMAGEEST_REAL_DATA", ""))
pytestmark = pytest.mark.skipif(
    not (DATA / "featuretype.STEP").is_file(), reason="DAMAGEEST_REAL_DATA names no folder with featuretype.STEP"
)


def job(part: str, **scan: object) -> dict[str, object]:
    scan = {"use": "simulate", "points": 80_000, "pose": "random", "seed": 4, **scan}
    return {"version": 1, "tolerance": 0.3, "part": str(DATA / part), "scan": scan}


@pytest.mark.slow
def test_a_corner_lost_from_a_step_part() -> None:
    part = damageest.run({**job("featuretype.STEP", pose="identity"), "align": "none"}).part
    low, high = part.bounds
    assert high - low == pytest.approx([127.0, 63.5, 34.925], abs=0.1)
    corner = {"tool": "sphere", "centre": low.tolist(), "radius": 14}
    result = damageest.run(job("featuretype.STEP", damage=[corner]))
    assert result.truth is not None
    assert result.truth[1] >= 0.97
    assert all(site.evidence.consistent for site in result.sites)


@pytest.mark.slow
def test_its_twin_in_inches_is_named_as_such() -> None:
    scan = damageest.run({**job("featuretype.STEP", pose="identity"), "align": "none"}).scan
    with pytest.raises(InputError, match=r"part\.unit: in"):
        damageest.run({"version": 1, "tolerance": 0.3, "part": str(DATA / "featuretype.STL")}, scan=scan.points)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plate_holes.STL", "angle_block.STL"])
def test_undamaged_parts_have_no_site(name: str) -> None:
    result = damageest.run({**job(name), "tolerance": "auto"})
    assert result.sites == ()


def test_a_scan_in_metres_with_fixture_reads() -> None:
    from damageest.stages.scan.file import ScanFile

    path = DATA / "openlmd_test4_downsampled.xyz"
    scan = ScanFile.model_validate({"path": path, "unit": "m"}).run(unit="mm")
    assert len(scan.points) == 43207
    assert 50 < float((scan.points.max(axis=0) - scan.points.min(axis=0)).max()) < 500

"""`damageest inspect`: what a step of a repair left out or put on too much is found, with its volume, and recorded."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import trimesh
from click.testing import Result
from manifold3d import Manifold
from typer.testing import CliRunner

import damageest
from damageest.artefacts import Part
from damageest.cli import app
from damageest.errors import InputError
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.inspection.aim import Aim, read_aim
from damageest.inspection.record import read_record
from tests import damaged_box
from tests.sections.blades import scan_mesh

JOB = (
    damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4")
    + "allowance: {use: milling, outer: 1.0, overlap: 0.5}\n"
)
SPACING, COARSE = 0.4, 1.0
BUMP = Manifold.sphere(2.0, 48).translate((3, 2, 11.2))
"""Too much on the deposit, whose top is 11 mm high."""
SHORT = Manifold.cylinder(3, 1.2, 1.2, 48).translate((-3, -1, 10.3))
"""Stock that was not deposited, down to 10.3 mm."""
HOLE = Manifold.cylinder(4, 1.2, 1.2, 48).translate((2, -3.5, 9))
"""Metal that was not deposited, down to 1 mm below the skin."""


@dataclass
class Repair:
    """A repair whose deposit was made with faults, as it was inspected."""

    folder: Path
    aim: Aim
    whole: Manifold
    status: int
    said: str
    record: dict[str, Any]


@pytest.fixture(scope="module")
def repair(tmp_path_factory: pytest.TempPathFactory) -> Repair:
    folder = tmp_path_factory.mktemp("repair")
    damageest.run(damaged_box.write(folder, JOB, 5000), output=folder / "out")
    aim = read_aim(folder / "out", "deposited")
    whole = to_manifold(aim.target)
    write_scan(whole + BUMP - SHORT - HOLE, folder / "after.ply")
    done = inspect(folder, "after.ply", "deposited")
    record = json.loads((folder / "out/record.json").read_text())
    return Repair(folder, aim, whole, done.exit_code, done.output, record)


def inspect(folder: Path, scan: str, step: str, *more: str) -> Result:
    """Of a part that was not moved, unless ``more`` says that it was."""
    setup = more or ("--same-setup",)
    return CliRunner().invoke(app, ["inspect", str(folder / "out"), str(folder / scan), "--step", step, *setup])


def write_scan(body: Manifold, path: Path, spacing: float = SPACING) -> None:
    trimesh.PointCloud(scan_mesh(Part(*to_arrays(body)), spacing, 0.03)).export(path)


def test_what_is_missing_short_and_over_is_found_with_its_volume(repair: Repair) -> None:
    nominal, (entry,) = to_manifold(repair.aim.nominal), repair.record["inspections"]
    lost = (nominal ^ HOLE).volume()
    truth = {
        "missing": lost,
        "stock short": (repair.whole ^ HOLE).volume() - lost + (repair.whole ^ SHORT).volume(),
        "over": (BUMP - repair.whole).volume(),
    }
    for kind, volume in truth.items():
        found = [one for one in entry["findings"] if one["kind"] == kind]
        assert {one["site"] for one in found} == {1}
        assert sum(one["volume"] for one in found) == pytest.approx(volume, rel=0.12), kind
    (verdict,) = entry["verdicts"]
    assert verdict["outcome"] == "not met"
    assert repair.status == 1
    assert "site 1: tolerance 0.4 mm not met" in repair.said


def test_the_record_has_the_life_of_the_repair_and_is_sealed(repair: Repair) -> None:
    record, path = repair.record, repair.folder / "out/record.json"
    result = json.loads((repair.folder / "out/result.json").read_text())
    assert record["workpiece"]["result_sha256"] == result["provenance"]["sha256"]
    assert record["deposition"]["allowance"]["outer"] == 1.0
    assert record["inspection_before"]["damage_volume"] == result["damage_volume"]
    assert read_record(path, repair.aim) == record
    page = (repair.folder / "out/record.html").read_text()
    assert "Site 1: tolerance not met" in page
    changed = json.loads(path.read_text())
    changed["inspections"][0]["verdicts"][0]["outcome"] = "met"
    other = repair.folder / "changed.json"
    other.write_text(json.dumps(changed))
    with pytest.raises(InputError, match="entry 1 was changed"):
        read_record(other)


@pytest.mark.slow
def test_a_good_part_after_milling_is_met_and_appended(repair: Repair) -> None:
    write_scan(to_manifold(repair.aim.nominal), repair.folder / "milled.ply", COARSE)
    done = inspect(repair.folder, "milled.ply", "milled")
    assert done.exit_code == 0, done.output
    assert "site 1: tolerance 0.4 mm met" in done.output
    record = read_record(repair.folder / "out/record.json", repair.aim)
    first, second = record["inspections"]
    assert second["previous"] == first["sha256"]
    assert not second["findings"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ground", "bead"])
def test_what_is_larger_than_the_site_makes_it_not_met(repair: Repair, kind: str) -> None:
    """The finding has most of its points elsewhere, and all of the site's."""
    whole = to_manifold(repair.aim.nominal)
    low, high = whole.bounding_box()[:3], whole.bounding_box()[3:]
    if kind == "ground":
        faulty = whole - Manifold.cube((100, 100, 9), True).translate((0, 0, high[2] + 4.5 - 0.6))
    else:
        bead = Manifold.cylinder(high[0] - low[0] - 4, 1.5, 1.5, 32, True).rotate((0, 90, 0))
        faulty = whole + bead.translate((0, 0, high[2]))
    write_scan(faulty, repair.folder / f"{kind}.ply", 0.7)
    done = inspect(repair.folder, f"{kind}.ply", "milled")
    assert done.exit_code == 1, done.output
    entry = read_record(repair.folder / "out/record.json", repair.aim)["inspections"][-1]
    (verdict,) = entry["verdicts"]
    assert verdict["outcome"] == "not met"
    assert set(entry["findings"][0]["sites"]) == {0, 1}
    if kind == "ground":
        assert verdict["lowest"] == pytest.approx(-0.6, abs=0.1)
    assert entry["whole"]["outcome"] == "not met"


@pytest.mark.slow
def test_a_repair_that_the_scan_does_not_show_is_not_met(repair: Repair) -> None:
    points = scan_mesh(repair.aim.nominal, 0.7, 0.03)
    hidden = (points[:, 2] > 9) & (points[:, 0] > 1) & (points[:, 0] < 9) & (abs(points[:, 1]) < 9)
    trimesh.PointCloud(points[~hidden & (points[:, 2] > 0)]).export(repair.folder / "partly.ply")
    done = inspect(repair.folder, "partly.ply", "milled")
    assert done.exit_code == 1
    assert "site 1: tolerance 0.4 mm not shown: the scan shows" in done.output


@pytest.mark.slow
def test_a_part_that_was_moved_is_fitted_to_its_skin(repair: Repair) -> None:
    """`pytest -m slow tests/inspection` runs it."""
    turned = (repair.whole + BUMP).rotate((10, 20, 30)).translate((5, 6, 7))
    write_scan(turned, repair.folder / "moved.ply")
    done = inspect(repair.folder, "moved.ply", "deposited", "--tolerance", "0.4")
    (one,) = read_record(repair.folder / "out/record.json", repair.aim)["inspections"][-1]["findings"]
    assert one["kind"] == "over"
    assert one["volume"] == pytest.approx((BUMP - repair.whole).volume(), rel=0.12)
    assert done.exit_code == 1


def test_a_folder_without_a_repair_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not an output folder"):
        read_aim(tmp_path, "milled")

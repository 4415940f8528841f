"""What `damageest run` says and writes of surplus."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from damageest.cli._run_table import MOST_SURPLUS, list_surplus
from damageest.findings import Surplus
from damageest.io.meshes import write_points
from damageest.output.result_json import result_schema
from tests.cli.calls import call
from tests.needs import import_or_skip
from tests.surplus_scenes import block, scan, slab, table

JOB = "version: 1\ntolerance: 0.25\nalign: none\npart: part.stl\nscan: scan.ply\nexport: {frame: both}\n"


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The output of a run on a block with a bead of 30 mm3 on a table, and what was printed."""
    folder = tmp_path_factory.mktemp("surplus")
    trimesh.creation.box((24, 18, 12)).export(folder / "part.stl")
    x, y, z = np.concatenate([scan(block() + slab((6, 5, 2), 0, 0, 6), 4000), table(count=1500)]).T
    write_points(folder / "scan.ply", {"x": x, "y": y, "z": z})
    (folder / "job.yaml").write_text(JOB)
    status, said = call("run", folder / "job.yaml")
    assert status == 0, said
    return folder / "out/job", said


@pytest.mark.slow
def test_surplus_is_in_the_table_and_the_report(told: tuple[Path, str]) -> None:
    out, said = told
    jsonschema = import_or_skip("jsonschema")
    report = json.loads((out / "result.json").read_text())
    jsonschema.validate(report, result_schema())
    bead, plane = report["surplus"]
    assert f"surplus 1: {bead['volume']:.3g} mm³, {bead['height']:.3g} mm high" in said
    assert "surplus 2 (surroundings): up to" in said
    assert abs(bead["volume"] - 30) < 3
    assert (bead["kind"], bead["file"], bead["beside"]) == ("surplus", "surplus/site-1.stl", [])
    assert (plane["kind"], plane["file"], plane["volume"]) == ("surroundings", None, None)


def test_surplus_is_a_file_in_each_frame(told: tuple[Path, str]) -> None:
    out, _ = told
    (bead, _) = json.loads((out / "result.json").read_text())["surplus"]
    for folder in (out, out / "scan_frame"):
        mesh = trimesh.load_mesh(folder / "surplus/site-1.stl")
        assert mesh.is_watertight
        assert abs(mesh.volume - bead["volume"]) < 1e-3


def make_surplus(number: int, kind: str = "surplus") -> Surplus:
    return Surplus(number, np.arange(3), 0.01, None, 0.1 * number, 2.0, kind, estimate=0.5)  # type: ignore[arg-type]


def test_many_small_surpluses_are_one_line_for_a_kind_with_an_estimate_of_their_volume() -> None:
    items = [*map(make_surplus, range(1, 13)), make_surplus(13, "displaced piece"), make_surplus(14, "surroundings")]
    lines = list_surplus(items, "mm")
    assert len(lines) == MOST_SURPLUS + 3
    assert "9 smaller ones" in lines[-1]
    assert "1.2 mm high, 18 mm²" in lines[-1]
    assert "open, about 4.5 mm³ (estimate" in lines[-1]
    assert [f"surplus {number} (" in line for number, line in zip((13, 14), lines[-3:-1], strict=True)] == [True, True]
    assert len(list_surplus(items[:3], "mm")) == 3
    pieces = [make_surplus(number, "displaced piece") for number in range(20, 60)]
    assert len(list_surplus([*items, *pieces], "mm")) == 2 * MOST_SURPLUS + 3

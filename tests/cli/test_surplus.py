"""What `damageest run` says and writes of surplus."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import trimesh

from damageest.io.meshes import write_points
from damageest.output.result_json import result_schema
from tests.cli.test_cli import call
from tests.surplus_scenes import TOLERANCE, block, scan, slab, table

JOB = f"version: 1\ntolerance: {TOLERANCE}\nalign: none\npart: part.stl\nscan: scan.ply\nexport: {{frame: both}}\n"


def test_surplus_is_in_the_table_the_files_and_the_report(tmp_path: Path) -> None:
    trimesh.creation.box((24, 18, 12)).export(tmp_path / "part.stl")
    x, y, z = np.concatenate([scan(block() + slab((6, 5, 2), 0, 0, 6), 12_000), table(count=3000)]).T
    write_points(tmp_path / "scan.ply", {"x": x, "y": y, "z": z})
    (tmp_path / "job.yaml").write_text(JOB)
    done = call("run", tmp_path / "job.yaml")
    assert done.returncode == 0, done.stderr
    out = tmp_path / "out/job"
    report = json.loads((out / "result.json").read_text())
    jsonschema.validate(report, result_schema())
    bead, plane = report["surplus"]
    assert f"surplus 1: {bead['volume']:.6g} mm³, {bead['height']:.4g} mm high" in done.stdout
    assert "surplus 2 (surroundings): up to" in done.stdout
    assert abs(bead["volume"] - 30) < 2
    assert (bead["kind"], bead["file"], bead["beside"]) == ("surplus", "surplus/site-1.stl", [])
    assert (plane["kind"], plane["file"], plane["volume"]) == ("surroundings", None, None)
    for folder in (out, out / "scan_frame"):
        mesh = trimesh.load_mesh(folder / "surplus/site-1.stl")
        assert mesh.is_watertight
        assert abs(mesh.volume - bead["volume"]) < 1e-3

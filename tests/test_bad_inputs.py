"""Invalid jobs and files: a defined exit status, a few lines that say what to do, and no file changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError
from damageest.io.meshes import write_points
from tests import damaged_box

Spoil = Callable[[Path], None]
POINTS = 2000


def job(text: str, whole: bool = False) -> Spoil:
    return lambda folder: (folder / "job.yaml").write_text(text if whole else damaged_box.JOB + text) and None


def file(name: str, content: bytes) -> Spoil:
    return lambda folder: (folder / name).write_bytes(content) and None


def scan(change: Callable[[np.ndarray], np.ndarray], extra: str = "") -> Spoil:
    def spoil(folder: Path) -> None:
        x, y, z = change(damaged_box.scan(POINTS)).T
        write_points(folder / "scan.ply", {"x": x, "y": y, "z": z})
        (folder / "job.yaml").write_text(damaged_box.JOB.replace("align: none\n", extra))

    return spoil


def part(make: Callable[[trimesh.Trimesh], trimesh.Trimesh]) -> Spoil:
    return lambda folder: make(trimesh.creation.box(damaged_box.SIZE)).export(folder / "box.stl") and None


def without_a_face(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    return mesh


def of_another_part(points: np.ndarray) -> np.ndarray:
    return np.asarray(trimesh.sample.sample_surface(trimesh.creation.torus(15, 4), 2000, seed=0)[0])


SIMULATE = "version: 1\npart: box.stl\nscan:\n  use: simulate\n  damage: [{}]\n"
CASES: dict[str, tuple[Spoil, int, str]] = {
    "empty job": (job("", True), 2, "mapping"),
    "a list": (job("- 1", True), 2, "mapping"),
    "not YAML": (job("cluster: ["), 2, "not valid YAML"),
    "tabs": (job("\tcluster: dbscan"), 2, "not valid YAML"),
    "same key twice": (job("part: box.stl\n"), 2, "duplicate key"),
    "binary job": (file("job.yaml", b"\xff\xfe\x00\x01"), 2, "text file"),
    "no part": (job("version: 1\nscan: scan.ply\n", True), 2, "part: path/to/file"),
    "no scan": (job("version: 1\npart: box.stl\n", True), 2, "scan: path/to/file"),
    "no version": (job("part: box.stl\nscan: scan.ply\n", True), 2, "version: 1"),
    "other version": (job("version: 9\npart: box.stl\nscan: scan.ply\n", True), 2, "expected 1"),
    "unknown stage": (job("segmnt: x"), 2, "did you mean 'segment'"),
    "unknown implementation": (job("cluster: kmeans"), 2, "there are: dbscan"),
    "unknown option": (job("cluster: {epz: 1}"), 2, "did you mean 'eps'"),
    "option of the wrong kind": (job("cluster: {neighbours: many}"), 2, "neighbours"),
    "option out of bounds": (job("cluster: {neighbours: -1}"), 2, "neighbours"),
    "negative tolerance": (
        job("version: 1\ntolerance: -2\npart: box.stl\nscan: scan.ply\n", True),
        2,
        "greater than 0",
    ),
    "unknown unit": (job("units: parsec"), 2, "units"),
    "unknown method": (job("method: octre"), 2, "method"),
    "stage of another route": (job("method: implicit\nboundary: all_loops"), 2, "not a stage of"),
    "part missing": (job("version: 1\npart: nix.stl\nscan: scan.ply\n", True), 2, "no such file"),
    "scan missing": (job("version: 1\npart: box.stl\nscan: [scan.ply, nix.ply]\n", True), 2, "no such file"),
    "part of an unknown kind": (job("version: 1\npart: job.yaml\nscan: scan.ply\n", True), 2, "no reader for '.yaml'"),
    "empty part": (file("box.stl", b""), 2, "empty"),
    "garbage part": (file("box.stl", bytes(range(256)) * 9), 2, "box.stl"),
    "truncated part": (
        file("box.stl", trimesh.creation.box(damaged_box.SIZE).export(file_type="stl")[:300]),
        2,
        "box.stl",
    ),
    "web page as part": (file("box.stl", b"<!DOCTYPE html><html>"), 2, "web page"),
    "open part": (part(without_a_face), 2, "open"),
    "empty scan": (file("scan.ply", b""), 2, "empty"),
    "garbage scan": (file("scan.ply", b"ply\nformat binary_little_endian 1.0\nelement"), 2, "scan.ply"),
    "scan of nothing": (scan(lambda p: p[:0]), 2, "scan.ply"),
    "scan of NaN": (scan(lambda p: p * np.nan), 2, "scan.ply"),
    "scan in metres": (scan(lambda p: p / 1000), 2, "scan.unit: m"),
    "scan in inches": (scan(lambda p: p / 25.4), 2, "scan.unit: in"),
    "part in inches": (part(lambda m: m.apply_scale(1 / 25.4)), 2, "part.unit: in"),
    "scan of another part": (scan(of_another_part, "align: icp\n"), 1, "align"),
    "scan of another part anywhere": (scan(of_another_part), 1, "align"),
    "tool that misses": (job(SIMULATE.format("{tool: sphere, centre: [99, 0, 0], radius: 1}"), True), 1, "misses"),
    "tool that takes all": (job(SIMULATE.format("{tool: sphere, centre: [0, 0, 0], radius: 99}"), True), 1, "simulate"),
    "unknown tool": (job(SIMULATE.format("{tool: hammer}"), True), 2, "tool"),
    "output is a file": (job("output: box.stl"), 2, "is a file"),
    "output is not ours": (job("output: mine"), 2, "not an earlier output"),
}


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=pytest.mark.slow if name.endswith("anywhere") else ()) for name in CASES]
)
def test_refused_with_a_reason(case: str, tmp_path: Path) -> None:
    spoil, status, text = CASES[case]
    path = damaged_box.write(tmp_path, points=POINTS)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    out = tmp_path / "out/job"
    out.mkdir(parents=True)
    (out / "result.json").write_text("an earlier result")
    spoil(tmp_path)
    outside = {name: data for name, data in damaged_box.content(tmp_path).items() if name not in ("job.yaml",)}

    done = CliRunner().invoke(app, ["run", str(path), "--quiet"])
    if done.exception and not isinstance(done.exception, SystemExit):
        assert isinstance(done.exception, DamageestError), repr(done.exception)
    assert done.exit_code == status, done.output
    assert text in done.stderr
    assert "Traceback" not in done.output
    assert len(done.stderr.splitlines()) <= 6
    after = damaged_box.content(tmp_path)
    assert {name: after.get(name) for name in outside} == outside

"""`damageest init` with units: the tolerance is measured in the unit that the job then has; paths are quoted."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from damageest.io.meshes import write_points
from damageest.job import load, yamlfile
from damageest.registry import Registry
from tests import damaged_box
from tests.cli.calls import call


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A part in millimetres, its scan in inches, and one in millimetres."""
    damaged_box.write(tmp_path, points=6000)
    x, y, z = damaged_box.scan(6000).T / 25.4
    write_points(tmp_path / "inches.ply", {"x": x, "y": y, "z": z})
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_the_tolerance_is_measured_in_the_unit_of_the_scan(home: Path) -> None:
    status, said = call("init", "box.stl", "inches.ply", "--job", "wrong.yaml")
    assert status == 0
    assert "set scan.unit: in" in said
    again = "damageest init box.stl inches.ply --job wrong.yaml --force --scan-unit UNIT"
    assert f"write the job again, do not only change the unit in it: {again}" in said
    status, said = call(*shlex.split(again.replace("UNIT", "inches"))[1:])
    assert (status, "unit" in said) == (0, False), said
    tree, _ = yamlfile.read(Path("wrong.yaml"))
    assert tree["scan"] == {"path": "inches.ply", "unit": "in"}
    assert call("init", "box.stl", "scan.ply", "--job", "right.yaml")[0] == 0
    assert tree["tolerance"] == pytest.approx(yamlfile.read(Path("right.yaml"))[0]["tolerance"], rel=0.01)
    assert "noise 0.04" in Path("wrong.yaml").read_text()
    load("wrong.yaml", Registry.discover())


def test_the_unit_of_the_part(home: Path) -> None:
    assert (
        call("init", "box.stl", "scan.ply", "-o", "a.yaml", "--units", "cm", "--part-unit", "mm", "--scan-unit", "mm")[
            0
        ]
        == 0
    )
    tree, _ = yamlfile.read(Path("a.yaml"))
    assert tree["part"] == {"path": "box.stl", "unit": "mm"}
    assert 0.01 < tree["tolerance"] < 0.02
    status, said = call("init", "box.stl", "scan.ply", "-o", "b.yaml", "--scan-unit", "inc")
    assert status == 2
    assert "--scan-unit: unknown unit 'inc'" in said
    assert not Path("b.yaml").exists()


def test_the_command_to_copy_is_quoted(home: Path) -> None:
    name = "Träger neu.yaml"
    status, said = call("init", "box.stl", "scan.ply", "--job", name)
    assert status == 0
    line = next(line for line in said.splitlines() if "next: " in line)
    assert shlex.split(line.partition("next: ")[2]) == ["damageest", "run", name]


def test_a_tolerance_in_another_unit_is_refused_before_the_alignment(home: Path) -> None:
    """By the command line: no pose is looked for."""
    job = home / "late.yaml"
    text = damaged_box.JOB.replace("align: none\n", "").replace("scan.ply", "{path: inches.ply, unit: in}")
    for tolerance, said in ((0.006, "is it in another unit"), (20.0, "no damage can be found")):
        job.write_text(text.replace("0.2", str(tolerance)))
        status, output = call("run", job)
        assert (status, said in output) == (2, True), output
        assert "align" not in output
    assert np.isclose(damaged_box.SIZE[2], 20.0), "twice the tolerance is more than each wall"

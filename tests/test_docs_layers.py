"""The example of the CAM page, run as it is printed: run, deposit, layers."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import damageest
from damageest.result import Result
from tests import damaged_box

PAGE = Path(__file__).parents[1] / "docs" / "cam.md"


@pytest.fixture
def script(tmp_path: Path) -> Path:
    (text,) = re.findall(r"```python\n# layers\.py\n(.*?)```", PAGE.read_text(), re.DOTALL)
    path = tmp_path / "layers.py"
    path.write_text(text)
    return path


def check_layers(said: str, error: float) -> None:
    """Asserts that the layers printed are those of a half ball of radius 6."""
    layers = [float(area) for area in re.findall(r"site 1, z \S+: (\S+) mm2, 1 outlines", said)]
    assert len(layers) == pytest.approx(6 / 0.25, abs=1)
    assert layers == sorted(layers), "each wider than the one below"
    assert layers[-1] == pytest.approx(113, rel=1.5 * error)
    summed, solid = map(float, re.findall(r"site 1: (\S+) mm3 in layers, (\S+) as a solid", said)[0])
    assert summed == pytest.approx(solid, rel=0.02)
    assert solid == pytest.approx(damaged_box.TRUE_VOLUME, rel=error)


def test_the_example_slices_a_deposit_into_layers(
    script: Path, small_result: Result, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(damageest, "run", lambda job: small_result)
    monkeypatch.setattr(sys, "argv", ["layers.py", "job.yaml", "0.25"])
    runpy.run_path(str(script), run_name="__main__")
    check_layers(capsys.readouterr().out, 0.05)


@pytest.mark.slow
def test_the_example_runs_a_job(script: Path, tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path)
    command = [sys.executable, script.name, job.name, "0.25"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    check_layers(done.stdout, 0.02)
    assert not (tmp_path / "out").exists()

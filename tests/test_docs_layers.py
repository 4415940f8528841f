"""The example of the CAM page, run as it is printed: run, deposit, layers."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests import damaged_box

PAGE = Path(__file__).parents[1] / "docs" / "cam.md"


def test_the_example_slices_the_deposit_into_layers(tmp_path: Path) -> None:
    (script,) = re.findall(r"```python\n# layers\.py\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "layers.py").write_text(script)
    job = damaged_box.write(tmp_path)
    command = [sys.executable, "layers.py", job.name, "0.25"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    layers = [float(area) for area in re.findall(r"site 1, z \S+: (\S+) mm2, 1 outlines", done.stdout)]
    assert len(layers) == pytest.approx(6 / 0.25, abs=1), "of a half ball of radius 6"
    assert layers == sorted(layers), "each wider than the one below"
    assert layers[-1] == pytest.approx(113, rel=0.03)
    summed, solid = map(float, re.findall(r"site 1: (\S+) mm3 in layers, (\S+) as a solid", done.stdout)[0])
    assert summed == pytest.approx(solid, rel=0.02)
    assert solid == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.02)
    assert not (tmp_path / "out").exists()

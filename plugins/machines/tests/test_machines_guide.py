"""The dialect of the plugin guide, taken from the page as it is printed, and what the shipped writers may cost."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from machine_checks import compare, load
from machine_readers import Read
from scipy.spatial.transform import Rotation

from damageest.stages.export import PathSettings
from tests.path_shapes import corner, plan

ROOT = Path(__file__).parents[3]
WRITERS = sorted((ROOT / "plugins" / "machines" / "damageest_machines" / "writers").glob("*.py"))
MOST = 80
"""Lines of a dialect."""


def read_dialect() -> str:
    text = (ROOT / "docs" / "plugin-guide.md").read_text()
    text = text[text.index("### A dialect of a control") :]
    found = re.search(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert found
    return found[1]


def read_urscript(text: str) -> Read:
    found, on = Read(), False
    part = re.search(r"part = p\[(.*?)\]", text)
    assert part
    for line in text.splitlines():
        if hit := re.match(r"  set_standard_digital_out\(0, (\w+)\)", line):
            on = hit[1] == "True"
        elif move := re.match(r"  movel\(pose_trans\(part, p\[(.*?)\]\), a=0.5, v=(.*?), r=(.*?)\)", line):
            values = np.array([float(word) for word in move[1].split(",")])
            axis = -Rotation.from_rotvec(values[3:]).as_matrix()[:, 2]
            found.add(1000 * values[:3], axis, float(move[2]) * 60000, on, {}, float(move[3]) == 0)
    return found


@pytest.mark.slow
def test_the_dialect_of_the_guide_follows_the_path(tmp_path: Path) -> None:
    path = plan(corner(), simulate=False, direction=(0.6, 0.48, 0.64), axes=5)
    space: dict[str, Any] = {"__name__": "acme_urscript"}
    exec(compile(read_dialect(), "acme_urscript.py", "exec"), space)
    commands = {name: {"lines": [f"set_standard_digital_out(0, {name == 'on'})"]} for name in ("on", "off")}
    machine = {**load("abb"), "process": commands}
    (tmp_path / "ur.yaml").write_text(json.dumps(machine))
    writer = space["damageest_path_writers"]()["urscript"]
    writer.write(tmp_path / "a.script", path, PathSettings("mm", "site 1", machine=tmp_path / "ur.yaml"))
    off = compare(path, read_urscript((tmp_path / "a.script").read_text()))
    assert off.point < 1e-3
    assert off.axis < 1e-3
    assert off.feed < 1e-3


def test_a_dialect_is_short() -> None:
    assert WRITERS
    assert [file.name for file in WRITERS if len(file.read_text().splitlines()) > MOST] == []
    assert len(read_dialect().splitlines()) <= MOST


def test_the_schema_in_the_repository_is_that_of_the_command() -> None:
    from damageest_machines.commands.machine import app
    from typer.testing import CliRunner

    said = CliRunner().invoke(app, ["schema"]).stdout
    assert json.loads(said) == json.loads((ROOT / "schemas" / "machine.schema.json").read_text())
    for words in (["list"], ["show", "kuka"], ["check", "kuka"]):
        assert CliRunner().invoke(app, words).exit_code == 0

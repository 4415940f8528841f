"""What a command imports before it says something: a person waits for that."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from damageest.registry import Registry
from damageest.registry.loading import OWN
from damageest.registry.registry import check_defaults
from tests import damaged_box

HEAVY = {
    "scipy",
    "trimesh",
    "vtkmodules",
    "pyvista",
    "igl",
    "manifold3d",
    "cadquery",
    "jinja2",
    "psutil",
    "distributed",
}
"""Libraries that take 20 ms or more each."""
WATCH = f"""
import sys
from damageest.cli import app

class First:
    '''A stream that notes what was imported when the first text was written to it.'''
    def __init__(self, stream):
        self.stream, self.loaded = stream, None
    def write(self, text):
        if self.loaded is None and text.strip():
            self.loaded = {{name.split(".")[0] for name in sys.modules}} | set(sys.modules)
        return self.stream.write(text)
    def __getattr__(self, name):
        return getattr(self.stream, name)

sys.stdout, sys.stderr = first = First(sys.stdout), First(sys.stderr)
for words in sys.argv[1:]:
    for one in first:
        one.loaded = None
    sys.argv = ["damageest", *words.split()]
    try:
        app()
    except SystemExit:
        pass
    loaded = [one.loaded for one in first if one.loaded]
    print("LOADED", *sorted(loaded[-1] & {HEAVY | {"numpy", "pydantic", "rich", "damageest.pipeline.engine"}}))
"""


def find_loaded(folder: Path, *commands: str) -> dict[str, set[str]]:
    """The libraries that have been imported when a command writes its first text, one command after the other."""
    done = subprocess.run([sys.executable, "-c", WATCH, *commands], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    lines = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("LOADED")]
    return {command: set(line) for command, line in zip(commands, lines, strict=True)}


def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    for command, loaded in find_loaded(tmp_path, "--help", "run --help", "batch --help", "validate --help").items():
        assert loaded <= {"pydantic"}, command  # typer imports it


@pytest.mark.slow
def test_validate_imports_numpy_alone(tmp_path: Path) -> None:
    damaged_box.write_least(tmp_path)
    assert find_loaded(tmp_path, "validate job.yaml") == {"validate job.yaml": {"numpy", "pydantic"}}


@pytest.mark.slow
def test_a_run_says_its_name_before_it_imports_what_it_runs_on(tmp_path: Path) -> None:
    damaged_box.write_least(tmp_path)
    (tmp_path / "box.stl").write_bytes(b"nonsense")  # so that it ends soon
    assert find_loaded(tmp_path, "run job.yaml") == {"run job.yaml": {"numpy", "pydantic", "rich"}}


def test_defaults_of_the_built_ins_are_valid() -> None:
    """A command checks those of plugins alone."""
    registry = Registry.discover()
    built_in = [item.cls for item in registry.implementations if item.provider.name == OWN]
    assert len(built_in) > 30
    for cls in built_in:
        check_defaults(cls)

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
sys.argv = ["damageest", *sys.argv[1:]]
try:
    app()
except SystemExit:
    pass
loaded = [one.loaded for one in first if one.loaded]
print("LOADED", *sorted(loaded[-1] & {HEAVY | {"numpy", "pydantic", "rich", "damageest.pipeline.engine"}}))
"""


def find_loaded(folder: Path, *words: str) -> set[str]:
    """The libraries that a command has imported when it writes its first text."""
    command = [sys.executable, "-c", WATCH, *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=True)
    lines = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("LOADED")]
    return set(lines[0])


@pytest.mark.parametrize("words", [(), ("run",), ("batch",), ("validate",)])
def test_help_imports_nothing_heavy(words: tuple[str, ...], tmp_path: Path) -> None:
    assert find_loaded(tmp_path, *words, "--help") <= {"pydantic"}  # typer imports it


def test_validate_imports_numpy_alone(tmp_path: Path) -> None:
    damaged_box.write_small(tmp_path)
    assert find_loaded(tmp_path, "validate", "job.yaml") == {"numpy", "pydantic"}


def test_a_run_says_its_name_before_it_imports_what_it_runs_on(tmp_path: Path) -> None:
    damaged_box.write_small(tmp_path)
    assert find_loaded(tmp_path, "run", "job.yaml") == {"numpy", "pydantic", "rich"}


def test_defaults_of_the_built_ins_are_valid() -> None:
    """A command checks those of plugins alone."""
    registry = Registry.discover()
    built_in = [item.cls for item in registry.implementations if item.provider.name == OWN]
    assert len(built_in) > 30
    for cls in built_in:
        check_defaults(cls)

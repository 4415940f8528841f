"""The whole test tree on a machine that lacks a package, or a system library: it is collected, and what cannot run is
skipped with the reason. `tests/test_optional_imports.py` holds the first by reading, in seconds."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.optional_imports import PROJECTS, ROOT, list_optional, list_required

OPTIONAL = list_optional()
NATIVE = ("cadquery", "open3d-cpu", "pymeshlab", "pyvista", "vtk", "python-fcl", "numba")
"""Packages that load libraries of the system."""
LIBRARY = "libGL.so.1"
LIBRARIES = ("libGL.so.1", "libEGL.so.1", "libX11.so.6", "libOpenGL.so.0")
TEXTS = {
    path: path.read_text()
    for folder in ("tests", "plugins", "benchmarks")
    for path in sorted((ROOT / folder).rglob("*.py"))
    if "tests" in path.parts and path.stem not in ("test_collection", "test_optional_imports")
}
HIDE = ROOT / "tests" / "blocking" / "hide_libraries"
REASONS = {
    "open3d": "Open3D needs libEGL.so.1, libGL.so.1",
    "pymeshlab": "PyMeshLab needs libGL.so.1, libOpenGL.so.0",
    "cadquery": "CadQuery needs libGL.so.1, libX11.so.6",
}
"""Why the tests of these plugins are skipped where none of `LIBRARIES` is there."""


def run_pytest(*options: str, blocked: tuple[str, ...] = (), lacks: str = "", before: tuple[str, ...] = ()) -> str:
    """What pytest says. Fails where it ends with another status than 0, or 5: no test is collected."""
    environment = os.environ | {
        "DAMAGEEST_BLOCKED": ",".join(blocked),
        "DAMAGEEST_LACKS": lacks,
        "PYTHONPATH": str(HIDE.parent),
    }
    command = [*before, sys.executable, "-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider", *options]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 5), done.stdout[-6000:] + done.stderr[-2000:]
    return done.stdout


def list_users(package: str) -> list[str]:
    """The files of tests that import a package, themselves or by a file of helpers, and those of the plugins that
    require it."""
    modules = OPTIONAL[package]
    plugins = [folder / "tests" for name, folder in PROJECTS.items() if set(modules) & set(list_required(name))]
    found = {path for path in TEXTS if path.parent not in plugins and _imports(path, modules)}
    helpers = tuple(path.stem for path in found if not path.stem.startswith("test_"))
    found |= {path for path in TEXTS if helpers and path.parent not in plugins and _imports(path, helpers)}
    users = sorted(path for path in found if path.stem.startswith("test_"))
    return [str(path.relative_to(ROOT)) for path in (*plugins, *users)]


def _imports(path: Path, modules: tuple[str, ...]) -> bool:
    names = "|".join(modules)
    pattern = rf"^\s*(?:import|from)\s[^#\n]*\b(?:{names})\b|import_(?:or_skip|for)\([^)]*\"(?:{names})\b"
    return re.search(pattern, TEXTS[path], re.MULTILINE) is not None


@pytest.mark.slow
@pytest.mark.parametrize("lacks", ["", LIBRARY])
def test_the_tree_is_collected_without_any_optional_package(lacks: str) -> None:
    modules = tuple(module for modules in OPTIONAL.values() for module in modules)
    said = run_pytest("--collect-only", "-m", "", blocked=modules, lacks=lacks)
    assert "error" not in said.splitlines()[-1]


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    ("package", "lacks"), [*((name, "") for name in OPTIONAL), *((name, LIBRARY) for name in NATIVE)]
)
def test_without_a_package_the_tree_is_collected_and_its_tests_are_skipped(package: str, lacks: str) -> None:
    run_pytest("--collect-only", "-m", "", blocked=OPTIONAL[package], lacks=lacks)
    if users := list_users(package):
        run_pytest(*users, blocked=OPTIONAL[package], lacks=lacks)


def find_obstacle() -> str:
    """Why no library can be hidden here; empty where it can."""
    if sys.platform != "linux" or os.geteuid() != 0:
        return "needs Linux and root, to mount a folder without the libraries"
    if shutil.which("unshare") is None:
        return "needs unshare: apt-get install util-linux"
    done = subprocess.run([HIDE, LIBRARY, "true"], capture_output=True, text=True, check=False)
    return f"the libraries cannot be hidden here: {done.stderr.strip()}" if done.returncode else ""


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_on_a_machine_without_graphics_libraries_nothing_fails() -> None:
    if obstacle := find_obstacle():
        pytest.skip(obstacle)
    hidden = (str(HIDE), *LIBRARIES)
    run_pytest("--collect-only", "-m", "", before=hidden)
    folders = [f"plugins/{name}/tests" for name in REASONS]
    said = run_pytest(*folders, before=hidden)
    skipped = [line for line in said.splitlines() if line.startswith("SKIPPED")]
    for reason in REASONS.values():
        assert any(reason in line and "apt-get install lib" in line for line in skipped), said[-3000:]

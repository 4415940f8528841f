"""The structure of the package, where import contracts do not reach: underscores, and what lies at the top."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted([*(ROOT / "damageest").rglob("*.py"), *(ROOT / "plugins").glob("*/damageest_*/**/*.py")])


def imported(path: Path) -> Iterator[str]:
    """Every module and every name that a file imports, in full."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_folder_imports_another_folders_underscore(path: Path) -> None:
    parts = path.parent.parts
    own = ".".join(
        parts[max(k for k, part in enumerate(parts) if part == "damageest" or part.startswith("damageest_")) :]
    )
    for name in imported(path):
        if not name.startswith("damageest"):
            continue
        parts = name.split(".")
        hidden = next((k for k, part in enumerate(parts) if part.startswith("_") and not part.endswith("__")), None)
        if hidden is not None:
            assert ".".join(parts[:hidden]).startswith(own), f"{name} is private to its folder"


def test_few_modules_lie_at_the_top() -> None:
    top = {path.name for path in (ROOT / "damageest").glob("*.py")}
    assert top == {
        "__init__.py", "__main__.py", "api.py", "error_codes.py", "errors.py", "findings.py", "options.py", "result.py",
    }  # fmt: skip


def test_the_core_names_no_module_of_a_plugin() -> None:
    """Plugins come in through hooks; messages name packages, of which `registry/bundled.py` is the list."""
    modules = [path.name for path in (ROOT / "plugins").glob("*/damageest_*")]
    assert len(modules) == len(list((ROOT / "plugins").glob("*/pyproject.toml")))
    sources = {path: path.read_text() for path in (ROOT / "damageest").rglob("*.py")}
    assert not [(path.name, name) for path, text in sources.items() for name in modules if name in text]


def test_the_package_is_typed() -> None:
    assert (ROOT / "damageest" / "py.typed").is_file()


def test_architecture_names_each_folder() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    folders = {path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "damageest").glob("*/__init__.py")}
    assert not [folder for folder in folders if f"{folder.split('/')[1]}/" not in text]


LISTED = ("artefacts", "batches", "checks", "io", "isolation", "job", "registry")
"""Folders of which ARCHITECTURE.md lists the modules: every one, so that a reader who looks for one finds it."""


@pytest.mark.parametrize("folder", LISTED)
def test_architecture_names_each_module_of_a_folder_that_it_lists(folder: str) -> None:
    rows = (ROOT / "ARCHITECTURE.md").read_text().splitlines()
    (row,) = [line for line in rows if line.startswith(f"| `{folder}/` |")]
    modules = [path.name for path in (ROOT / "damageest" / folder).glob("*.py") if path.name != "__init__.py"]
    assert not [name for name in modules if f"`{name}`" not in row]


def test_architecture_names_no_module_that_is_not_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    there = {path.name for folder in ("damageest", "plugins", "tests") for path in (ROOT / folder).rglob("*.py")}
    named = {Path(name).name for name in re.findall(r"`([\w/]+\.py)`", text)}
    assert named
    assert not named - there

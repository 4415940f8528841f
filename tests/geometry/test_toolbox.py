"""Rules for the toolbox as a whole: each module tested and documented, no import from above, libigl in one place."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import damageest.geometry

FOLDER = Path(damageest.geometry.__file__).parent
ROOT = Path(__file__).parents[2]
MODULES = sorted(path for path in FOLDER.glob("*.py") if path.name != "__init__.py")
ABOVE = {"stages", "pipeline", "registry", "job", "checks", "io", "output", "cli", "api", "conformance"}


def list_imports(path: Path) -> list[str]:
    """Every module that a file imports, and every name as if it were a module, wherever the import stands."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = ".".join(["damageest", "geometry"][: 3 - node.level]) if node.level else ""
            module = ".".join(filter(None, [above, node.module]))
            found += [module, *(f"{module}.{alias.name}" for alias in node.names)]
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_each_module_has_tests_of_its_own(path: Path) -> None:
    tests = Path(__file__).parent / f"test_{path.name}"
    assert tests.is_file()
    assert f"damageest.geometry.{path.stem}" in list_imports(tests)


def test_each_test_file_has_a_module() -> None:
    tests = {path.name.removeprefix("test_") for path in Path(__file__).parent.glob("test_*.py")} - {
        "toolbox.py",
        "few_rows.py",
    }
    assert tests == {path.name for path in MODULES}


def list_undocumented(path: Path) -> list[str]:
    """The public functions, classes and methods of a file without a docstring."""
    tree = ast.parse(path.read_text())
    missing = [] if ast.get_docstring(tree) else ["the module"]
    bodies: list[tuple[str, list[ast.stmt]]] = [("", tree.body)]
    while bodies:
        prefix, body = bodies.pop()
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                if not ast.get_docstring(node):
                    missing.append(prefix + node.name)
                if isinstance(node, ast.ClassDef):
                    bodies.append((f"{node.name}.", node.body))
    return missing


@pytest.mark.parametrize("path", [*MODULES, FOLDER / "__init__.py"], ids=lambda path: path.stem)
def test_everything_public_has_a_docstring(path: Path) -> None:
    assert list_undocumented(path) == []


@pytest.mark.parametrize("path", [*MODULES, FOLDER / "__init__.py"], ids=lambda path: path.stem)
def test_nothing_from_above_is_imported(path: Path) -> None:
    names = [name.split(".") for name in list_imports(path)]
    assert not [name for name in names if name[0] == "damageest" and len(name) > 1 and name[1] in ABOVE]
    assert not [name for name in names if name[0].startswith("damageest_")]


def test_libigl_is_imported_by_few_modules() -> None:
    sources = [*(ROOT / "damageest").rglob("*.py"), *(ROOT / "plugins").glob("*/damageest_*/**/*.py")]
    users = {path for path in sources if any(name.split(".")[0] == "igl" for name in list_imports(path))}
    thinning = ROOT / "plugins/cadquery/damageest_cadquery/_polyhedron.py"  # asks libigl for fewer triangles
    own = {FOLDER / f"{name}.py" for name in ("distance", "isosurface", "long_faces", "pseudonormals", "rays")}
    assert users == {*own, thinning}

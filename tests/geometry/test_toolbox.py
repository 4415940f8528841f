"""Rules for the toolbox as a whole: each module tested and documented, no import from above, libigl in one place."""

from __future__ import annotations

import ast
from pathlib import Path

import damageest.geometry
from tests.sources import ROOT, SOURCES, list_imported

FOLDER = Path(damageest.geometry.__file__).parent
MODULES = sorted(path for path in FOLDER.glob("*.py") if path.name != "__init__.py")
ABOVE = {"stages", "pipeline", "registry", "job", "checks", "io", "output", "cli", "api", "conformance"}


def test_each_module_has_tests_of_its_own() -> None:
    assert MODULES
    tests = {path: Path(__file__).parent / f"test_{path.name}" for path in MODULES}
    assert not [str(test) for test in tests.values() if not test.is_file()]
    assert not [path.stem for path in MODULES if f"damageest.geometry.{path.stem}" not in list_imported(tests[path])]


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


def test_everything_public_has_a_docstring() -> None:
    missing = {path.name: list_undocumented(path) for path in [*MODULES, FOLDER / "__init__.py"]}
    assert not {name: found for name, found in missing.items() if found}


def is_above(name: str) -> bool:
    """Whether a module or name lies in a layer above the toolbox."""
    package, _, rest = name.partition(".")
    return package.startswith("damageest_") or (package == "damageest" and rest.partition(".")[0] in ABOVE)


def test_nothing_from_above_is_imported() -> None:
    files = [*MODULES, FOLDER / "__init__.py"]
    assert not [(path.name, name) for path in files for name in list_imported(path) if is_above(name)]
    assert is_above("damageest.stages")
    assert is_above("damageest_octree.cut")
    assert not is_above("damageest.geometry.rays")


def test_libigl_is_imported_by_few_modules() -> None:
    users = {path for path in SOURCES if any(name.split(".")[0] == "igl" for name in list_imported(path))}
    thinning = ROOT / "plugins/cadquery/damageest_cadquery/surfaces/polyhedron.py"  # asks libigl for fewer triangles
    own = {FOLDER / f"{name}.py" for name in ("distance", "isosurface", "long_faces", "pseudonormals", "rays")}
    assert users == {*own, thinning}

"""No file of tests needs, to be collected, a package that a machine may lack: else pytest ends with an error where the
file's tests would be skipped. `tests/test_collection.py` tries it, which takes minutes; this reads the files."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec

import pytest

from tests.optional_imports import ROOT, find_chains, list_optional, list_required, map_modules

REMEDY = "import it in the test, or by import_or_skip or import_for of tests/needs.py"


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    return {name: path.read_text() for name, path in map_modules().items()}


def is_test(name: str) -> bool:
    return name.rpartition(".")[2].startswith("test_") or "conftest" in name


def test_no_file_of_tests_imports_an_optional_package(sources: dict[str, str]) -> None:
    files = [path for folder in ("tests", "plugins", "benchmarks") for path in (ROOT / folder).rglob("test_*.py")]
    files += [ROOT / "conftest.py", *ROOT.glob("tests/**/conftest.py"), *ROOT.glob("plugins/*/tests/conftest.py")]
    assert sum(is_test(name) for name in sources) == len(files) > 300
    found = [chain for name, needed in find_chains(sources).items() if is_test(name) for chain in needed.values()]
    assert not found, REMEDY


MADE_UP = {
    "tests.test_direct": "import os, numba.core\n",
    "tests.test_of_a_part": "from sklearn.cluster import DBSCAN\n",
    "tests.test_in_a_class": "class A:\n    from OCP import gp\n",
    "tests.test_under_if": "if True:\n    import pyvista as pv\n",
    "tests.test_by_another": "from tests import help_two\n",
    "tests.help_two": "from tests.help_one import made\n",
    "tests.help_one": "import fcl\nmade = 3\n",
    "tests.test_by_its_package": "import tests.kit.plain\n",
    "tests.kit": "import k3d\n",
    "tests.kit.plain": "",
}
PASS = {
    "tests.test_in_a_function": "def test_it():\n    import numba\n",
    "tests.test_for_types": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import pyvista\n",
    "tests.test_caught": "try:\n    import k3d\nexcept ImportError:\n    k3d = None\n",
    "tests.test_guarded": "from tests.needs import import_or_skip\nnumba = import_or_skip('numba')\n",
    "tests.test_of_the_core": "import numpy\nimport hypothesis\nfrom tests import needs\n",
    "tests.test_alike": "import numbat\nfrom tests.numba import b\n",
}


def test_the_check_finds_each_way_to_import_one_and_no_other() -> None:
    chains = {name: needed for name, needed in find_chains(MADE_UP | PASS).items() if is_test(name)}
    assert {name: sorted(needed) for name, needed in chains.items()} == {
        "tests.test_direct": ["numba"],
        "tests.test_of_a_part": ["sklearn"],
        "tests.test_in_a_class": ["OCP"],
        "tests.test_under_if": ["pyvista"],
        "tests.test_by_another": ["fcl"],
        "tests.test_by_its_package": ["k3d"],
    }
    assert chains["tests.test_by_another"]["fcl"] == "tests.test_by_another -> tests.help_two -> tests.help_one -> fcl"


def test_the_list_is_that_of_the_project_files() -> None:
    optional = list_optional()
    assert {"cadquery", "numba", "pillow", "scikit-learn", "nbformat", "trame", "gmsh"} <= set(optional)
    assert not {"numpy", "trimesh", "hypothesis", "pytest", "damageest-paths", "ruff"} & set(optional)
    assert {"numba", "fcl", "pyvista"} <= set(list_required("paths"))
    assert list_required("octree") == ()


def test_each_package_is_installed_as_the_modules_that_are_said() -> None:
    """A wrong name in the table would block nothing, and find nothing."""
    there = {name: modules for name, modules in list_optional().items() if is_installed(name)}
    assert len(there) > 5
    assert not [module for modules in there.values() for module in modules if find_spec(module) is None]


def is_installed(package: str) -> bool:
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True

"""Which packages a machine may lack, by the pyproject.toml files, and which modules of the repository import one when
they are imported."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]

PROJECTS = {path.parent.name: path.parent for path in sorted(ROOT.glob("plugins/*/pyproject.toml"))}
PROJECTS |= {"benchmarks": ROOT / "benchmarks"}
"""The folders of the packages beside the core, by the end of their name: the plugins, and the benchmarks."""

NEEDED_BY_TESTS = frozenset({"pytest", "pytest-xdist", "pytest-timeout", "hypothesis"})
"""Without these no test runs."""

TOOLS = frozenset({"ruff", "mypy", "scipy-stubs", "types-jsonschema", "types-psutil", "pre-commit", "pytest-cov"})
"""No file imports these."""

MODULES: Mapping[str, tuple[str, ...]] = {
    "cadquery": ("cadquery", "OCP"),
    "open3d-cpu": ("open3d",),
    "libusb-package": ("libusb_package",),
    "pyvista": ("pyvista",),
    "vtk": ("vtk", "vtkmodules"),
    "pillow": ("PIL",),
    "gtc": ("GTC",),
    "distributed": ("distributed", "dask"),
    "python-fcl": ("fcl",),
    "scikit-learn": ("sklearn",),
    "antlr4-python3-runtime": ("antlr4",),
    "mkdocs-material": ("material",),
    "mkdocstrings": ("mkdocstrings",),
    "import-linter": ("importlinter",),
    "trame": ("trame", "trame_client", "trame_server"),
}
"""What is imported of a package, where that is not its name with underscores."""


def name_distribution(requirement: str) -> str:
    """The package of a requirement: of ``laspy[lazrs]>=2.5`` it is ``laspy``."""
    found = re.match(r"[\w.-]+", requirement)
    return found[0].lower() if found else ""


def list_required(plugin: str) -> tuple[str, ...]:
    """The modules of the packages that a plugin requires beside the core."""
    optional = list_optional()
    core = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    lines = tomllib.loads((PROJECTS[plugin] / "pyproject.toml").read_text())["project"]["dependencies"]
    for line in list(lines):
        if line.startswith("damageest["):
            for extra in line.partition("[")[2].partition("]")[0].split(","):
                lines += core[extra]
    names = dict.fromkeys(name_distribution(line) for line in lines)
    return tuple(module for name in names for module in optional.get(name, ()))


@cache
def list_optional() -> dict[str, tuple[str, ...]]:
    """The packages that are neither the core's nor needed by every test, each with the modules that it brings."""
    core: set[str] = set()
    named: set[str] = set()
    for path in (ROOT / "pyproject.toml", *(folder / "pyproject.toml" for folder in PROJECTS.values())):
        content = tomllib.loads(path.read_text())
        project = content["project"]
        required = {name_distribution(line) for line in project["dependencies"]}
        core |= required if path.parent == ROOT else set()
        groups = [*project.get("optional-dependencies", {}).values(), *content.get("dependency-groups", {}).values()]
        named |= required | {name_distribution(line) for group in groups for line in group if isinstance(line, str)}
    own = {name for name in named if name.partition("-")[0] == "damageest"}
    left = sorted(named - core - own - NEEDED_BY_TESTS - TOOLS)
    return {name: MODULES.get(name, (name.replace("-", "_"),)) for name in left}


def find_imports(source: str) -> Iterator[str]:
    """What a file imports when it is imported, in full: ``a.b`` and, of ``from a.b import c``, ``a.b.c``. What stands
    in functions, under ``if TYPE_CHECKING`` and in a ``try`` that catches ImportError is left out."""
    waiting: list[ast.stmt] = list(reversed(ast.parse(source).body))
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            waiting += reversed(list(_list_inner(node)))


def _list_inner(node: ast.stmt) -> Iterator[ast.stmt]:
    if isinstance(node, ast.If) and ast.unparse(node.test).rpartition(".")[2] == "TYPE_CHECKING":
        yield from node.orelse
        return
    guarded = isinstance(node, ast.Try) and any(
        "Import" in ast.unparse(one.type) or "Module" in ast.unparse(one.type) for one in node.handlers if one.type
    )
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt) and not (guarded and child in getattr(node, "body", [])):
            yield child
        elif isinstance(child, ast.ExceptHandler | ast.match_case):
            yield from child.body


@cache
def map_modules() -> dict[str, Path]:
    """The repository's modules by the name under which they are imported."""
    found: dict[str, Path] = {}
    for base, folders in (
        (ROOT, [ROOT / "damageest", ROOT / "tests"]),
        *((place, list(place.glob("damageest_*"))) for place in PROJECTS.values()),
        *((place / "tests", [place / "tests"]) for place in PROJECTS.values()),
    ):
        for path in (path for folder in folders for path in folder.rglob("*.py")):
            parts = path.relative_to(base).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    # nobody imports these by name, and several may have the same
    found |= {path.relative_to(ROOT).as_posix(): path for path in ROOT.glob("plugins/*/tests/conftest.py")}
    return found | {"conftest": ROOT / "conftest.py"}


def find_chains(sources: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Of each module that needs optional ones where it is imported: these, each with the chain of imports to it.

    ``sources``: the text of each module, by its name. A text that cannot name what is looked for is not parsed.
    """
    optional = {module for modules in list_optional().values() for module in modules}
    chains: dict[str, dict[str, str]] = {}
    direct = re.compile(rf"^[ \t]*(?:import|from)\s[^#\n]*\b(?:{'|'.join(sorted(optional))})\b", re.MULTILINE)
    statements = {name: _list_statements(source) for name, source in sources.items()}
    for name, source in sources.items():
        if direct.search(statements[name]):
            for imported in parse_imports(source):
                if (top := imported.partition(".")[0]) in optional:
                    chains.setdefault(name, {}).setdefault(top, f"{name} -> {imported}")
    fresh = set(chains)
    while fresh:
        words = _match_imports_of(fresh)
        grown: set[str] = set()
        for name, source in sources.items():
            if words.search(statements[name]):
                loaded = {part for imported in parse_imports(source) for part in _list_packages(imported)}
                for needed in sorted(loaded & fresh - {name}):
                    for module, chain in list(chains[needed].items()):
                        if module not in chains.setdefault(name, {}):
                            chains[name][module] = f"{name} -> {chain}"
                            grown.add(name)
        fresh = grown
    return {name: needed for name, needed in chains.items() if needed}


def _list_statements(source: str) -> str:
    """The lines of a text that begin an import: to search these takes a fraction of the time."""
    return "\n".join(line for line in source.splitlines() if line.lstrip().startswith(("import ", "from ")))


def _match_imports_of(names: Iterable[str]) -> re.Pattern[str]:
    """Matches each text that may import one of the modules: that names it, or takes something out of its package."""
    whole = "|".join(re.escape(name) for name in sorted(names))
    packages = "|".join(sorted({re.escape(name.rpartition(".")[0]) for name in names if "." in name})) or "(?!)"
    return re.compile(rf"^[ \t]*(?:(?:import|from)\s+(?:{whole})\b|from\s+(?:{packages})\s+import\b)", re.MULTILINE)


def _list_packages(name: str) -> Iterator[str]:
    """A dotted name and those before it, whose files its import executes too."""
    parts = name.split(".")
    return (".".join(parts[:count]) for count in range(1, len(parts) + 1))


@cache
def parse_imports(source: str) -> tuple[str, ...]:
    """As `find_imports`, each text once."""
    return tuple(find_imports(source))

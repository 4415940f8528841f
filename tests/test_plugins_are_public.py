"""The bundled plugins use nothing of damageest that any other plugin could not use."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import damageest
from damageest import isolation, job
from damageest import registry as registry_package
from tests.sources import PLUGIN_SOURCES, ROOT, find_imports, list_imports, parse_imports

PLUGINS = ROOT / "plugins"

PUBLIC_NAMES = {
    "damageest": set(damageest.__all__) | {""},
    "damageest.isolation": set(isolation.__all__),
    "damageest.job": set(job.__all__),
    "damageest.registry": set(registry_package.__all__),
    "damageest.rules": {"Rule", "SiteCase", "SiteFacts", "ScanFacts", "FreePose", "Term", "Share", "LossCase"},
}
"""Packages of which only the names that they list are public, without their modules."""
PUBLIC_MODULES = {
    "damageest.artefacts",
    "damageest.batches.cluster",
    "damageest.batches.tasks",
    "damageest.errors",
    "damageest.findings",
    "damageest.geometry",
    "damageest.io",
    "damageest.options",
    "damageest.registry.contracts",
    "damageest.registry.system_libraries",
    "damageest.result",
}
"""Public modules, with the modules in them."""
EXCEPTIONS = {
    "damageest_app": {"damageest.job.yamlfile", "damageest.output.folder"},
    "damageest_cadquery": {"damageest.stages.allowance.plain_stock"},
    "damageest_evaluate": {
        "damageest.trust.scan_quality",
        "damageest.job.yamlfile",
        "damageest.stages.scan.scanner",
        "damageest.stages.scan.simulate",
        "damageest.stages.scan.tools",
    },
    "damageest_machines": {"damageest.job.yamlfile"},
}
"""Modules that one plugin uses although they are not public: the evaluation makes its scans with the virtual scanner,
at the tolerance that a run would take; exact stock is compared with the stage's on the exact damage volume's own skin;
the app edits the text of job files, and shows what a run wrote; machine files are read as job files are. The list in
pyproject.toml is the same for what is forbidden there."""


def is_public(module: str, name: str) -> bool:
    """Whether a plugin may import this name of this module; ``name`` is empty for `import module`."""
    parts = module.split(".")
    if any(part.startswith("_") for part in [*parts, name]):
        return False
    if module in PUBLIC_NAMES:
        return name in PUBLIC_NAMES[module]
    if parts[:2] == ["damageest", "stages"]:  # the base class and the contracts, without their implementations
        return len(parts) <= 3 and bool(name) and not is_implementation(parts, name)
    return any(module == public or module.startswith(f"{public}.") for public in PUBLIC_MODULES)


def is_implementation(parts: list[str], name: str) -> bool:
    """Whether the name is a module or a room of one stage, as in `from damageest.stages.enclose import adaptive`."""
    folder = Path(*parts)
    return len(parts) == 3 and any((PLUGINS.parent / folder / one).exists() for one in (f"{name}.py", name))


def list_private_attributes(source: str) -> list[str]:
    """Attributes `module._name` of names that were imported from damageest."""
    if not re.search(r"\b\w+\._[^\W_]", source.replace("self._", "")):
        return []  # most files; parsing them takes long
    tree = ast.parse(source)
    names = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "damageest"
        for alias in node.names
    }
    return [
        f"{node.value.id}.{node.attr}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in names
        if node.attr.startswith("_") and not node.attr.startswith("__")
    ]


def is_of_damageest(module: str) -> bool:
    return module.split(".")[0] == "damageest"


def list_private_imports(imports: list[tuple[str, str]], plugin: str) -> list[str]:
    """Those of the imports that a plugin may not use."""
    excepted = EXCEPTIONS.get(plugin, set())
    return [
        f"{module}: {name}"
        for module, name in imports
        if is_of_damageest(module) and not is_public(module, name) and module not in excepted
    ]


def test_exceptions_are_needed() -> None:
    for plugin, modules in EXCEPTIONS.items():
        files = [file for file in PLUGIN_SOURCES if file.relative_to(PLUGINS).parts[1] == plugin]
        assert modules == {module for file in files for module, _ in list_imports(file)} & modules


def test_there_are_plugins() -> None:
    assert {file.relative_to(PLUGINS).parts[0] for file in PLUGIN_SOURCES} >= {"cadquery", "octree", "open3d", "sweep"}


def test_a_plugin_uses_public_names_only() -> None:
    private = []
    for file in PLUGIN_SOURCES:
        source, plugin = file.read_text(encoding="utf-8"), file.relative_to(PLUGINS).parts[1]
        used = list_private_attributes(source)
        if list_private_imports(list_imports(file), plugin):  # or it writes a program into a text
            used += list_private_imports(parse_imports(source), plugin)
        private += [f"{file.relative_to(PLUGINS)}: {one}" for one in used]
    assert not private, "\n".join(private)


@pytest.mark.parametrize(
    "line",
    [
        "from damageest.geometry.body_repair import _label",
        "from damageest.stages.enclose._sew import build_strip",
        "from damageest.stages.enclose.adaptive import Adaptive",
        "from damageest.stages.enclose import adaptive",
        "from damageest.stages.align import symmetry",
        "from damageest.stages.align.symmetry.choose import choose_pose",
        "import damageest.stages.enclose.adaptive",
        "from damageest.pipeline.engine import Engine",
        "from damageest.job.check import load",
        "from damageest.batches.run import batch",
        "from damageest import api",
        "from damageest.trust.doubts.wide_interval import WideInterval",
        "def f():\n    import damageest.pipeline",
    ],
)
def test_private_imports_are_found(line: str) -> None:
    assert list_private_imports(find_imports(line), "any")
    assert list_private_imports(parse_imports(line), "any")


def test_private_attributes_are_found() -> None:
    assert list_private_attributes("from damageest.io import meshes\nmeshes._read('a.stl')") == ["meshes._read"]

"""What messages say of packages that are not installed agrees with what the packages bring."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from damageest.cli._commands import load_commands
from damageest.errors import InputError, JobError, describe_install
from damageest.job import load
from damageest.registry import Registry, bundled
from tests.job.test_schema import own
from tests.needs import PLUGINS, needs_plugin


@needs_plugin(*PLUGINS)
def test_the_lists_are_what_the_packages_bring(registry: Registry) -> None:
    ours = own(registry)
    added = {
        (i.contract.stage, i.name): i.provider.name for i in ours.implementations if i.provider.name != "damageest"
    }
    assert added == bundled.IMPLEMENTATIONS
    assert {name: made.name for name, made in registry.formats.items() if made.name != "damageest"} == bundled.FORMATS
    methods = {item.method: item.provider.name for item in ours.of("enclose") if item.method not in ("", "surface")}
    assert {name: made for name, made in methods.items() if made == bundled.METHODS.get(name)} == bundled.METHODS
    suffixes = {s: i.provider.name for i in ours.of("part") for s in i.cls.reads if i.provider.name != "damageest"}
    assert suffixes == bundled.SUFFIXES
    commands = {name: package for package, made in load_commands().items() for name in made}
    assert commands == bundled.COMMANDS


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> Registry:
    """A registry in which no plugin is installed."""
    monkeypatch.setattr("damageest.registry.loading._list_installed", list)
    return Registry.discover()


@pytest.mark.parametrize(
    ("lines", "package"),
    [
        *((f"{stage}: {{use: {name}}}", package) for (stage, name), package in bundled.IMPLEMENTATIONS.items()),
        *((f"method: {name}", package) for name, package in bundled.METHODS.items()),
        *((f"export: {{format: {name}}}", package) for name, package in bundled.FORMATS.items()),
    ],
)
def test_a_job_says_which_package_it_needs(lines: str, package: str, bare: Registry, tmp_path: Path) -> None:
    (tmp_path / "job.yaml").write_text(
        "version: 1\n" + ("" if lines.startswith("part") else "part: p.stl\n") + f"scan: s.ply\n{lines}\n"
    )
    with pytest.raises(JobError) as caught:
        load(tmp_path / "job.yaml", bare)
    (told,) = [text for text in caught.value.lines() if package in text]
    assert "which is not installed" in told
    assert describe_install(package) in told


@pytest.mark.parametrize("kind", bundled.CONVERSIONS)
def test_a_conversion_says_which_package_it_needs(kind: str, bare: Registry) -> None:
    with pytest.raises(InputError, match=f"needs the plugin {bundled.CONVERSIONS[kind]}, which is not installed"):
        bare.conversions[kind](None, "damage", 1)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if k else ()) for k, name in enumerate(bundled.COMMANDS)]
)
def test_a_command_says_which_package_it_needs(name: str) -> None:
    code = f"""
import sys
from damageest.registry import loading
loading._list_installed = list
from damageest.cli import main
sys.argv = ["damageest", "{name}", "any"]
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert f"needs the plugin {bundled.COMMANDS[name]}, which is not installed" in done.stderr
    assert describe_install(bundled.COMMANDS[name]) in " ".join(done.stderr.split())


def test_commands_of_plugins_import_nothing_large() -> None:
    """The list of all commands, and the help of a plugin's, are there at once."""
    code = """
import sys
sys.argv = ["damageest", "evaluate", "--help"]
from damageest.cli import main
try:
    main()
except SystemExit:
    print("LOADED", *(name for name in sys.modules if "." not in name))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    (loaded,) = re.findall(r"^LOADED (.*)$", done.stdout, re.MULTILINE)
    large = {
        "scipy",
        "trimesh",
        "pyvista",
        "vtkmodules",
        "igl",
        "manifold3d",
        "matplotlib",
        "fcl",
        "distributed",
        "dask",
    }
    assert not large & set(loaded.split())


def test_a_plugin_whose_commands_fail_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "acme_bad.py").write_text("def damageest_commands(app):\n    raise RuntimeError('no display')\n")
    info = tmp_path / "acme_bad-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-bad\nVersion: 1.0\nLicense: MIT\n")
    (info / "entry_points.txt").write_text("[damageest]\nbad = acme_bad\n")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv = ['damageest', '--help']\n"
    code += "from damageest.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "evaluate" in done.stdout
    assert "acme-bad 1.0" in done.stderr
    assert "no display" in done.stderr

"""What others build packages and images of says the same as pyproject.toml and the plugins."""

from __future__ import annotations

import importlib
import re
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def read_dockerfile() -> dict[str, str]:
    """The text of each stage by its name, comments left out, lines that go on joined."""
    lines = [line for line in (ROOT / "Dockerfile").read_text().splitlines() if not line.startswith("#")]
    text = "\n".join(lines).replace("\\\n", " ")
    return dict(re.findall(r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM |\Z)", text, re.DOTALL | re.MULTILINE))


def test_the_conda_recipe_has_the_dependencies_of_the_core_and_its_page() -> None:
    text = (ROOT / "conda/recipe.yaml").read_text()
    recipe = YAML(typ="safe").load(text)
    assert recipe["context"]["version"] == PROJECT["version"]
    needed = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["report"]]
    wanted = {re.sub(r"\s*;.*", "", one).replace(">=", " >=") for one in needed}
    renamed = dict(re.findall(r"- (\S+) .*# pip: (\S+)", text))
    found = set()
    for line in recipe["requirements"]["run"]:
        name, _, version = line.partition(" ")
        if name == "python":
            assert version == PROJECT["requires-python"]
        elif version:
            found.add(f"{renamed.get(name, name)} {version}")
    assert found == wanted
    assert recipe["build"]["python"]["entry_points"] == [f"damageest = {PROJECT['scripts']['damageest']}"]


def test_every_image_runs_as_a_user_without_rights() -> None:
    text, stages = (ROOT / "Dockerfile").read_text(), read_dockerfile()
    for name in ("core", "all"):
        assert f"FROM run AS {name}\n" in text
        assert stages[name].strip().endswith("\nUSER damageest"), "nothing is done as root after it"
    assert "\nWORKDIR /data\n" in stages["run"]
    assert '\nENTRYPOINT ["damageest"]\n' in stages["run"]
    assert list(stages)[-1] == "core", "the one that is built where no target is named"


@pytest.mark.parametrize("plugin", ["open3d", "pymeshlab", "cadquery"])
def test_the_image_with_all_plugins_has_their_system_libraries(plugin: str) -> None:
    needed = set(importlib.import_module(f"damageest_{plugin}._system").PACKAGES.values())
    assert not needed - set(read_dockerfile()["all"].split())


@pytest.mark.parametrize("plugin", ["open3d", "pymeshlab", "cadquery"])
def test_installation_names_the_system_libraries_of_all_plugins(plugin: str) -> None:
    needed = set(importlib.import_module(f"damageest_{plugin}._system").PACKAGES.values())
    page = (ROOT / "docs/install.md").read_text()
    (line,) = re.findall(r"--all-packages --all-extras\napt-get install (.*)", page)
    assert not needed - set(line.split())


def test_the_benchmarks_are_in_no_image_and_no_wheel() -> None:
    benchmarks = tomllib.loads((ROOT / "benchmarks/pyproject.toml").read_text())["project"]
    left_out = set(re.findall(r"--no-install-package (\S+)", read_dockerfile()["build-all"]))
    alone = {re.split(r"\W*[>=]", name)[0] for name in benchmarks["optional-dependencies"]["drift"]}
    assert {benchmarks["name"], *alone} <= left_out
    assert not re.findall(r"uv build.*--all-packages", (ROOT / "docs/install.md").read_text())


def test_the_context_of_the_image_is_what_a_build_needs() -> None:
    kept = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    needed = {"damageest", "plugins", "pyproject.toml", PROJECT["readme"], *PROJECT["license-files"]}
    assert needed <= kept
    assert all((ROOT / name).exists() for name in kept - {"uv.lock"})


def test_workflows_are_yaml_and_run_scripts_that_are_there() -> None:
    for path in (ROOT / ".github/workflows").glob("*.yml"):
        text = path.read_text()
        assert YAML(typ="safe").load(text)["jobs"]
        assert "Not run yet" in text
        assert all((ROOT / name).is_file() for name in re.findall(r"(\.ci/\w+)", text))


def test_the_bare_debian_is_made_by_a_short_script() -> None:
    """It is read by those who doubt it; the README is where it learns what to install."""
    assert len((ROOT / ".ci/bare-debian").read_text().splitlines()) <= 110
    assert re.findall(r"apt-get install ([\w -]+)", (ROOT / "README.md").read_text()) == ["python3 python3-venv git"]

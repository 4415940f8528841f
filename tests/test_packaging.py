"""What others build packages and images of says the same as pyproject.toml and the plugins."""

from __future__ import annotations

import importlib
import importlib.util
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def load_dockerfile() -> tuple[Any, dict[str, Any]]:
    spec = importlib.util.spec_from_file_location("dockerfile", ROOT / ".ci/dockerfile.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    import sys

    sys.modules["dockerfile"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module, module.read(ROOT / "Dockerfile")


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
    module, stages = load_dockerfile()
    for name in ("core", "all"):
        assert stages[name].steps[-1] == ("USER", "damageest"), "nothing is done as root after it"
        assert module.inherit(stages, name, "WORKDIR") == "/data"
        assert module.read_list(module.inherit(stages, name, "ENTRYPOINT")) == ["damageest"]
    assert "${" not in stages["base"].source
    assert list(stages)[-1] == "core", "the one that is built where no target is named"


@pytest.mark.parametrize("plugin", ["open3d", "pymeshlab", "cadquery"])
def test_the_image_with_all_plugins_has_their_system_libraries(plugin: str) -> None:
    _, stages = load_dockerfile()
    installed = {word for step, words in stages["all"].steps if step == "RUN" for word in words.split()}
    assert not set(importlib.import_module(f"damageest_{plugin}._system").PACKAGES.values()) - installed


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

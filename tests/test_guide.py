"""The plugins of the plugin guide, taken from the page as they are printed, work outside the repository."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import trimesh
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.conformance import StageContract
from damageest.errors import JobError
from damageest.job import load
from damageest.registry import Registry
from tests import damaged_box

GUIDE = Path(__file__).parents[1] / "docs" / "plugin-guide.md"
FIRST = ("pyproject.toml", "acme_shrinkage.py", "test_shrinkage.py")
TRIAL = ("trial/pyproject.toml", "trial/acme_trial.py", "trial/test_trial.py")


def files() -> dict[str, str]:
    """The files that the page has; blocks of the same file are joined."""
    found: dict[str, list[str]] = {}
    for name, text in re.findall(r"```\w+\n# (\S+)\n(.*?)```", GUIDE.read_text(), re.DOTALL):
        found.setdefault(name, []).append(text)
    return {name: "\n\n".join(blocks) for name, blocks in found.items()}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, dict[str, str]]]:
    """The folder of the plugins, and the environment that has them installed; this process has them too."""
    folder = tmp_path_factory.mktemp("acme")
    for name, text in files().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    (folder / "first").mkdir()
    for name in FIRST:
        (folder / name).rename(folder / "first" / name)
    site = tmp_path_factory.mktemp("site")
    uv = os.environ.get("UV") or shutil.which("uv")
    pip = [uv, "pip"] if uv else [sys.executable, "-m", "pip"]
    at = ["--offline", "--python", sys.executable] if uv else []
    done = subprocess.run(
        [*pip, "install", "--quiet", *at, "--no-deps", "--no-build-isolation", "--target", str(site),
         str(folder / "first"), str(folder / "trial")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with pytest.MonkeyPatch.context() as patch:
        for path in (*(str(folder / name) for name in ("first", "trial")), str(site)):
            patch.syspath_prepend(path)
        yield folder, {**os.environ, "PYTHONPATH": str(site)}
    for name in [name for name in sys.modules if re.match(r"(acme|test)_(shrinkage|trial)", name)]:
        del sys.modules[name]


def call(*words: str) -> str:
    """What a command prints."""
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return done.output


def refuse(job: Path) -> str:
    """The fault of a job."""
    with pytest.raises(JobError) as caught:
        load(job, Registry.discover())
    return str(caught.value)


def test_the_page_has_the_files_of_two_plugins() -> None:
    assert sorted(files()) == sorted((*FIRST, *TRIAL))


@pytest.mark.usefixtures("installed")
def test_they_are_listed_with_their_options() -> None:
    plugins = call("plugins")
    assert "acme-shrinkage 1.0  MIT  allowance: shrinkage" in plugins
    assert "acme-trial 1.0  MIT  segment: two_sided, repair: fan, enclose: hull" in plugins
    assert "[acme-shrinkage 1.0]" in call("stages", "allowance")
    assert "linear shrinkage of the deposit" in call("stages", "allowance", "shrinkage")


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_a_job_is_validated_with_the_first_and_runs(small_done: Path) -> None:
    text = small_done.read_text()
    small_done.write_text(text + "allowance: {use: shrinkage, percent: 30}\n")
    assert "percent" in refuse(small_done)
    small_done.write_text(text + "allowance: {use: shrinkage, percent: 10}\n")
    call("validate", str(small_done))
    call("run", str(small_done))
    out = small_done.parent / "out" / "job"
    damage, deposit = (trimesh.load_mesh(out / name / "site-1.stl") for name in ("damage", "deposit"))
    assert deposit.volume == pytest.approx(1.1**3 * damage.volume, rel=1e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_the_job_of_the_second_runs(tmp_path: Path) -> None:
    (text,) = re.findall(r"```yaml\n(version: 1.*?)```", GUIDE.read_text(), re.DOTALL)
    job = tmp_path / "job.yaml"
    job.write_text(text.replace("parts/", f"{GUIDE.parents[1] / 'jobs' / 'parts'}/") + "report: none\n")
    assert "segment two_sided took" in call("run", str(job)), "its observer is called"
    (site,) = json.loads((tmp_path / "out" / "job" / "result.json").read_text())["sites"]
    assert site["verdict"]["level"] == "likely", "its rule keeps a sparse site from being proven"
    assert "acme_density" in [one["code"] for one in site["verdict"]["reasons"]]
    written = trimesh.load_mesh(tmp_path / "out" / "job" / "damage" / "site-1.off")
    assert written.is_watertight
    truth = trimesh.load_mesh(tmp_path / "out" / "job" / "truth" / "damage.stl")
    assert written.volume == pytest.approx(truth.volume, rel=0.1)


@pytest.mark.usefixtures("installed")
def test_its_repair_runs(tmp_path: Path) -> None:
    job = damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4") + "repair: {use: fan, widest: 5}\n"
    assert "repair fan took" in call("run", str(damaged_box.write(tmp_path, job, 2500)))


@pytest.mark.usefixtures("installed")
def test_its_rule_and_its_nested_options_are_listed(tmp_path: Path) -> None:
    assert "fewer scan points lie on the site than the house's" in call("schema", "reasons")
    assert "limits" in call("stages", "segment", "two_sided")
    assert "height beyond which a point is added metal" in call("schema", "job")
    job = damaged_box.write_small(tmp_path, "segment: {use: two_sided, limits: {outside: '3'}}\n")
    assert "segment.limits.outside" in refuse(job)


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_its_conversion_gives_an_object_of_the_other_library(small_done: Path) -> None:
    result = damageest.run(small_done, output=True)
    mesh = result.convert("pyvista", "damage", 1)
    assert type(mesh).__name__ == "PolyData"
    assert mesh.volume == pytest.approx(result.damage_volume, rel=1e-3)


@pytest.mark.parametrize(("module", "count"), [("test_shrinkage", 1), ("test_trial", 4)])
@pytest.mark.usefixtures("installed")
def test_their_own_tests_have_the_checks_of_their_contracts(module: str, count: int) -> None:
    """The first of the checks; all are made by -m slow."""
    values = vars(importlib.import_module(module)).values()
    made: list[Any] = [
        cls() for cls in values if isinstance(cls, type) and issubclass(cls, StageContract) and hasattr(cls, "stage")
    ]
    assert len(made) == count
    for one in made:
        one.test_declares_itself()


@pytest.mark.slow
@pytest.mark.parametrize(("plugin", "least"), [("first", 6), ("trial", 30)])
def test_their_own_tests_pass(plugin: str, least: int, installed: tuple[Path, dict[str, str]]) -> None:
    folder, env = installed
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:dash", str(folder / plugin)]
    done = subprocess.run(command, cwd=folder / plugin, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert int(re.findall(r"(\d+) passed", done.stdout)[0]) >= least

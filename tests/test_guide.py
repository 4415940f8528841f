"""The plugins of the plugin guide, taken from the page as they are printed, work outside the repository."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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
def installed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """The folder of the plugins, and the environment that has them installed."""
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
    return folder, {**os.environ, "PYTHONPATH": str(site)}


def call(words: list[str], folder: Path, env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from damageest.cli import main; main()", *words]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)


def test_the_page_has_the_files_of_two_plugins() -> None:
    assert sorted(files()) == sorted((*FIRST, *TRIAL))


def test_they_are_listed_with_their_options(installed: tuple[Path, dict[str, str]]) -> None:
    folder, env = installed
    plugins = call(["plugins"], folder, env).stdout
    assert "acme-shrinkage 1.0  MIT  allowance: shrinkage" in plugins
    assert "acme-trial 1.0  MIT  segment: two_sided, repair: fan, enclose: hull" in plugins
    assert "[acme-shrinkage 1.0]" in call(["stages", "allowance"], folder, env).stdout
    assert "linear shrinkage of the deposit" in call(["stages", "allowance", "shrinkage"], folder, env).stdout


def test_a_job_is_validated_with_the_first_and_runs(installed: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    _, env = installed
    job = damaged_box.write(tmp_path, damaged_box.JOB + "allowance: {use: shrinkage, percent: 30}\n")
    refused = call(["validate", str(job)], tmp_path, env)
    assert refused.returncode == 2
    assert "percent" in refused.stderr + refused.stdout
    job.write_text(damaged_box.JOB + "allowance: {use: shrinkage, percent: 10}\n")
    assert call(["validate", str(job)], tmp_path, env).returncode == 0
    done = call(["run", str(job)], tmp_path, env)
    assert done.returncode == 0, done.stderr
    import trimesh

    out = tmp_path / "out" / "job"
    damage, deposit = (trimesh.load_mesh(out / name / "site-1.stl") for name in ("damage", "deposit"))
    assert deposit.volume == pytest.approx(1.1**3 * damage.volume, rel=1e-3)


def test_the_job_of_the_second_runs(installed: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    _, env = installed
    (lines,) = re.findall(r"```yaml\n(segment: .*?)```", GUIDE.read_text(), re.DOTALL)
    job = damaged_box.write(tmp_path, damaged_box.JOB + lines)
    done = call(["run", str(job)], tmp_path, env)
    assert done.returncode == 0, done.stderr
    assert "segment two_sided took" in done.stdout, "its observer is called"
    (site,) = json.loads((tmp_path / "out" / "job" / "result.json").read_text())["sites"]
    assert site["verdict"]["level"] == "likely", "its rule keeps a sparse site from being proven"
    assert "acme_density" in [one["code"] for one in site["verdict"]["reasons"]]
    import trimesh

    written = trimesh.load_mesh(tmp_path / "out" / "job" / "damage" / "site-1.off")
    assert written.is_watertight
    assert written.volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.03)

    job.write_text(damaged_box.JOB + "repair: {use: fan, widest: 5}\n")
    done = call(["run", str(job)], tmp_path, env)
    assert done.returncode == 0, done.stderr
    assert "repair fan took" in done.stdout


def test_its_rule_and_its_nested_options_are_listed(installed: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    folder, env = installed
    assert "fewer scan points lie on the site than the house's" in call(["schema", "reasons"], folder, env).stdout
    assert "limits" in call(["stages", "segment", "two_sided"], folder, env).stdout
    assert "height beyond which a point is added metal" in call(["schema", "job"], folder, env).stdout
    job = damaged_box.write_small(tmp_path, "segment: {use: two_sided, limits: {outside: '3'}}\n")
    refused = call(["validate", str(job)], tmp_path, env)
    assert refused.returncode == 2
    assert "segment.limits.outside" in refused.stderr + refused.stdout


def test_its_conversion_gives_an_object_of_the_other_library(
    installed: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    _, env = installed
    job = damaged_box.write_small(tmp_path)
    script = f"""
import damageest
result = damageest.run({str(job)!r})
mesh = result.convert("pyvista", "damage", 1)
print(type(mesh).__name__, round(mesh.volume / result.damage_volume, 3))
"""
    done = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True, check=False)
    assert done.stdout.endswith("PolyData 1.0\n"), done.stderr


@pytest.mark.parametrize(("plugin", "least"), [("first", 6), ("trial", 30)])
def test_their_own_tests_pass(plugin: str, least: int, installed: tuple[Path, dict[str, str]]) -> None:
    folder, env = installed
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:dash", str(folder / plugin)]
    done = subprocess.run(command, cwd=folder / plugin, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert int(re.findall(r"(\d+) passed", done.stdout)[0]) >= least

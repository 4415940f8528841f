"""The plugin of the guide in the README works outside the repository."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import damaged_box

README = Path(__file__).parents[1] / "README.md"
LINES_OF_A_PAGE = 80


def guide() -> str:
    return README.read_text().split("## Writing a stage\n")[1].split("\n## ")[0]


def files() -> dict[str, str]:
    blocks = re.findall(r"```\w+\n# (\S+)\n(.*?)```", guide(), re.DOTALL)
    return dict(blocks)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """The folder of the plugin, and the environment that has it installed."""
    folder = tmp_path_factory.mktemp("acme")
    for name, text in files().items():
        (folder / name).write_text(text)
    site = tmp_path_factory.mktemp("site")
    uv = os.environ.get("UV") or shutil.which("uv")
    pip = [uv, "pip"] if uv else [sys.executable, "-m", "pip"]
    at = ["--offline", "--python", sys.executable] if uv else []
    done = subprocess.run(
        [*pip, "install", "--quiet", *at, "--no-deps", "--no-build-isolation", "--target", str(site), str(folder)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder, {**os.environ, "PYTHONPATH": str(site)}


def call(words: list[str], folder: Path, env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from damageest.cli import main; main()", *words]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)


def test_the_guide_is_no_longer_than_a_page() -> None:
    assert len(guide().splitlines()) <= LINES_OF_A_PAGE
    assert list(files()) == ["pyproject.toml", "acme_shrinkage.py", "test_shrinkage.py"]


def test_it_is_listed_with_its_options(installed: tuple[Path, dict[str, str]]) -> None:
    folder, env = installed
    assert "acme-shrinkage 1.0  MIT  allowance: shrinkage" in call(["plugins"], folder, env).stdout
    assert "[acme-shrinkage 1.0]" in call(["stages", "allowance"], folder, env).stdout
    assert "linear shrinkage of the deposit" in call(["stages", "allowance", "shrinkage"], folder, env).stdout


def test_a_job_is_validated_with_it_and_runs(installed: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
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


def test_its_own_test_passes(installed: tuple[Path, dict[str, str]]) -> None:
    folder, env = installed
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:dash", str(folder)]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert int(re.findall(r"(\d+) passed", done.stdout)[0]) >= 6

"""A finished job that costs little to run again with another stage."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import damageest
from damageest.registry import Registry
from tests import damaged_box
from tests.kept import keep

TINY = damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4")


@pytest.fixture(scope="session")
def _tiny_job(test_run: Path, registry: Registry) -> Path:
    def make(folder: Path) -> None:
        damageest.run(damaged_box.write(folder, TINY, 1000), registry=registry, output=True)

    return keep(test_run, "tiny_job", make)


@pytest.fixture
def tiny_done(_tiny_job: Path, tmp_path: Path) -> Path:
    """As `small_done`, of a scan of 1000 points: what a run measures anew between kept stages takes less time."""
    shutil.copytree(_tiny_job, tmp_path, dirs_exist_ok=True)
    return tmp_path / "job.yaml"

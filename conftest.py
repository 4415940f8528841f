"""Fixtures of all tests, those of the plugins too."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import settings

import damageest
from damageest.registry import Registry
from damageest.result import Result
from tests import damaged_box
from tests.kept import keep

pytest_plugins = ["tests.costs", "tests.lacking"]
settings.register_profile("untimed", deadline=None)  # machines are noisy, and first calls compile
settings.load_profile("untimed")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of a test marked ``variants(n, slow=m)`` those after the first n are slow, and of the slow ones those after the
    first m nightly; so are those that `tests/nightly.txt` lists."""
    from tests.costs import read_nightly  # later: pytest rewrites the plugin's assertions when it loads it

    seen: Counter[str] = Counter()
    for item in items:
        if (mark := item.get_closest_marker("variants")) is None:
            continue
        name = item.nodeid.partition("[")[0]
        seen[name] += 1
        if mark.args and seen[name] > mark.args[0]:
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("slow") and "slow" in mark.kwargs:
            seen[name + " slow"] += 1
            if seen[name + " slow"] > mark.kwargs["slow"]:
                item.add_marker(pytest.mark.nightly)
    nightly = read_nightly()
    for item in items:
        if item.nodeid in nightly and item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.nightly)


@pytest.fixture(scope="session")
def test_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all processes of one run of pytest share."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "shared"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def part_store(test_run: Path) -> Iterator[Path]:
    """What is kept of parts goes to a folder of the run, not to the user's."""
    folder = test_run / "parts"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DAMAGEEST_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session")
def registry() -> Registry:
    return Registry.discover()


@pytest.fixture(scope="session")
def _small_job(test_run: Path, registry: Registry) -> Path:
    def make(folder: Path) -> None:
        damageest.run(damaged_box.write_small(folder), registry=registry, output=True)

    return keep(test_run, "small_job", make)


@pytest.fixture
def small_done(_small_job: Path, tmp_path: Path) -> Path:
    """The job of `damaged_box.write_small` in ``tmp_path``, with its finished output folder ``out/job``.

    It is computed once a run of pytest; each test has a copy of its own.
    """
    shutil.copytree(_small_job, tmp_path, dirs_exist_ok=True)
    return tmp_path / "job.yaml"


@pytest.fixture(scope="session")
def small_result(_small_job: Path, tmp_path_factory: pytest.TempPathFactory, registry: Registry) -> Result:
    """What `damageest.run` gives for that job, from its kept stages. Nobody changes it."""
    folder = tmp_path_factory.mktemp("small_result")
    shutil.copytree(_small_job, folder, dirs_exist_ok=True)
    return damageest.run(folder / "job.yaml", registry=registry, output=True)


@pytest.fixture
def job_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a job file, beside a small box as part and a few points as scan."""
    trimesh.creation.box((40, 30, 20)).export(tmp_path / "box.stl")
    np.savetxt(tmp_path / "scan.xyz", np.random.default_rng(0).normal(size=(50, 3)))

    least = "version: 1\npart: box.stl\nscan: scan.xyz\n"

    def write(body: str = "", head: str = least) -> Path:
        path = tmp_path / "job.yaml"
        path.write_text(head + body)
        return path

    return write

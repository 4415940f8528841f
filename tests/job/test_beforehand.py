"""What would fail after the work is told with the job: a picture, a package, the output folder."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from damageest.errors import JobError, describe_install
from damageest.job import beforehand, load
from damageest.registry import Registry
from tests import damaged_box
from tests.cli.calls import call


@pytest.fixture(scope="module")
def registry() -> Registry:
    return Registry.discover()


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beforehand")
    damaged_box.write(folder, points=100)
    (folder / "logo.png").write_text("<svg/>")
    return folder


def find_faults(home: Path, registry: Registry, more: str) -> list[str]:
    job = home / "job.yaml"
    job.write_text(damaged_box.JOB.replace("report: none\n", "") + more)
    try:
        load(job, registry)
    except JobError as error:
        return [line.removeprefix(str(job)) for line in error.lines()]
    return []


def test_a_logo_that_is_no_picture(home: Path, registry: Registry) -> None:
    if importlib.util.find_spec("reportlab") is None:
        pytest.skip("reportlab is not installed")
    (fault,) = find_faults(home, registry, "report: {pdf: true, logo: logo.png}\n")
    assert "logo.png is neither PNG nor JPEG" in fault


def test_a_package_of_the_method(home: Path, registry: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(beforehand, "find_spec", lambda name: None)
    (fault,) = find_faults(home, registry, "method: surface\n")
    assert "'pyvista' cannot run: the Python module pyvista is not installed" in fault
    assert describe_install("vtk") in fault
    assert not find_faults(home, registry, ""), "it is only tried where the other method fails"


def test_the_output_folder(home: Path) -> None:
    job = damaged_box.write(home / "other", damaged_box.JOB + "output: job.yaml/out\n", 100)
    status, said = call("validate", job)
    assert status == 2
    assert "job.yaml is a file, not a folder; name another folder" in said

"""What cadquery says where a system library is missing; these tests run without it too."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import damageest_cadquery
import pytest
from damageest_cadquery import _system
from damageest_cadquery.brep import Brep
from damageest_cadquery.reading import read as _read

from damageest.errors import JobError, PluginError, StageError
from damageest.job import load
from damageest.registry import Registry

GEAR = Path(__file__).parents[3] / "jobs" / "parts" / "gear.step"


@pytest.fixture
def _without_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that has all libraries but libGL."""

    def load_others(library: str) -> None:
        if library == "libGL.so.1":
            raise OSError(f"{library}: cannot open shared object file")

    monkeypatch.setattr(_system, "load", load_others)


@pytest.mark.usefixtures("_without_gl")
def test_a_missing_system_library_leaves_a_remedy() -> None:
    with pytest.raises(PluginError, match=r"CadQuery needs libGL\.so\.1 from the system") as caught:
        damageest_cadquery.damageest_stages()
    assert caught.value.remedy.startswith("apt-get install libgl1,")
    registry = Registry.discover()
    assert [b.remedy for b in registry.broken if b.provider.name == "damageest-cadquery"] == [caught.value.remedy]
    assert "step" not in registry.writers


@pytest.mark.usefixtures("_without_gl")
@pytest.mark.parametrize(
    ("body", "place"),
    [
        ({"part": str(GEAR)}, "part.path"),
        ({"part": "a.stl", "export": {"format": "step"}}, "export.format.0"),
        ({"part": "a.stl", "export": {"spline": True}}, "export.spline"),
    ],
)
def test_a_job_that_needs_it_is_told_why_and_what_to_do(
    body: dict[str, object], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a.stl", "b.ply"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(JobError) as caught:
        load({"version": 1, "scan": "b.ply", **body}, Registry.discover())
    (fault,) = caught.value.faults
    assert fault.where == place
    assert "needs the plugin damageest-cadquery, which cannot be used here (CadQuery needs libGL.so.1" in fault.message
    assert "try: apt-get install libgl1" in fault.message
    assert "pip install" not in fault.message


@pytest.mark.usefixtures("_without_gl")
def test_the_file_is_not_at_fault() -> None:
    with pytest.raises(PluginError, match=r"needs libGL\.so\.1"):
        Brep(path=GEAR).run(unit="mm", tolerance=None)
    with pytest.raises(PluginError, match=r"needs libGL\.so\.1"):
        Brep(path=GEAR).cad_faces("mm")


def raise_in_read(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def check() -> None:
        raise error

    monkeypatch.setattr(_read, "check", check)


def test_another_library_that_does_not_load_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    raise_in_read(monkeypatch, ImportError("libXrender.so.1: cannot open shared object file: No such file"))
    with pytest.raises(StageError, match=r"the system library libXrender\.so\.1 is missing"):
        Brep(path=GEAR).run(unit="mm", tolerance=None)


def test_an_interrupt_stays_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenCASCADE's modules raise ImportError where Ctrl-C stops their import."""
    stopped = ImportError("initialization failed")
    stopped.__cause__ = KeyboardInterrupt()
    raise_in_read(monkeypatch, stopped)
    with pytest.raises(KeyboardInterrupt):
        Brep(path=GEAR).run(unit="mm", tolerance=None)
    with pytest.raises(KeyboardInterrupt):
        Brep(path=GEAR).cad_faces("mm")


def test_the_stages_are_listed_without_importing_cadquery() -> None:
    code = (
        "import sys, damageest_cadquery as d\n"
        "from damageest.errors import PluginError\n"
        "try: d.damageest_stages()\n"
        "except PluginError: pass\n"
        "sys.exit('OCP' in sys.modules or 'cadquery' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

"""The core without its extras: a run finds the damage, and says which package brings what it leaves out."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import Solid
from damageest.errors import EXTRAS, StageError, describe_install
from damageest.geometry import isosurface
from damageest.isolation import end_workers
from tests import damaged_box

COARSE = damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4")


@pytest.fixture(autouse=True)
def without_extras(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Modules of the extras do not load, in this process and in those that it starts; those of earlier tests end."""
    end_workers()
    folder = tmp_path_factory.mktemp("hidden")
    for module in EXTRAS:
        (folder / f"{module}.py").write_text(f"raise ModuleNotFoundError('no {module} here', name='{module}')\n")
    for name in [name for name in sys.modules if name.partition(".")[0] in EXTRAS]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(str(folder))
    yield
    end_workers()


@pytest.mark.slow
def test_a_run_needs_no_extra_and_names_the_one_of_the_page(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, COARSE.replace("report: none\n", ""), 1000)
    result = damageest.run(job, output=tmp_path / "out")
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.15)
    said = [str(warning) for warning in result.warnings if warning.code == "report"]
    assert said == [
        "report.html was not written: the Python module k3d is not installed; the extra 'report' brings it. "
        + describe_install("report")
    ]
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    assert any(describe_install("report") in str(one) for one in written["warnings"])
    assert (tmp_path / "out" / "damage" / "site-1.stl").is_file()
    assert not (tmp_path / "out" / "report.html").exists()


def test_the_method_of_the_paper_names_its_extra(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, COARSE + "method: surface\n", 2000)
    with pytest.raises(StageError, match=re.escape(describe_install("vtk"))):
        damageest.run(job)


@pytest.mark.slow
def test_where_the_first_method_gives_no_site_the_extra_of_the_second_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = damaged_box.write(tmp_path, COARSE + "method: auto\n", 2000)
    monkeypatch.setattr(isosurface, "extract_region", lambda grid, field: None)
    with pytest.raises(StageError, match="method surface cannot be tried: .*\n.*" + re.escape(describe_install("vtk"))):
        damageest.run(job)


@pytest.mark.slow
def test_where_the_scan_contradicts_a_site_the_extra_is_told_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = damaged_box.write(tmp_path, COARSE + "method: auto\n", 2000)
    wrong = trimesh.creation.icosphere(radius=9).apply_translation((0, 0, 10))
    monkeypatch.setattr(isosurface, "extract_region", lambda grid, field: Solid(wrong.vertices, wrong.faces))
    result = damageest.run(job, settings=["accept=all"])
    assert len(result.sites) == 1
    assert [note.remedy for note in result.warnings if note.code == "fell_back"] == [describe_install("vtk")]


@pytest.mark.slow
def test_a_scan_in_a_format_of_an_extra_names_it(tmp_path: Path) -> None:
    job = damaged_box.write_small(tmp_path)
    (tmp_path / "scan.vtk").write_text(
        "# vtk DataFile Version 3.0\nscan\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n"
    )
    (tmp_path / "scan.e57").write_bytes(make_e57_header())
    for name, extra in (("scan.vtk", "vtk"), ("scan.e57", "e57")):
        with pytest.raises(StageError, match=re.escape(describe_install(extra))):
            damageest.run(job, settings=[f"scan={name}"])


def make_e57_header() -> bytes:
    """As much of a file as is read before the library is asked."""
    header = b"ASTM-E57" + np.array([1, 0], "<u4").tobytes() + np.array([1024, 48, 8, 1024], "<u8").tobytes()
    return header + bytes(1024 - len(header))

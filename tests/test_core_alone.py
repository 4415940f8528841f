"""The core without its extras: a run finds the damage, and says which package brings what it leaves out."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import damageest
from damageest.errors import EXTRAS, StageError
from tests import damaged_box


@pytest.fixture(autouse=True)
def without_extras(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Modules of the extras do not load, in this process and in those that it starts."""
    folder = tmp_path_factory.mktemp("hidden")
    for module in EXTRAS:
        (folder / f"{module}.py").write_text(f"raise ModuleNotFoundError('no {module} here', name='{module}')\n")
    for name in [name for name in sys.modules if name.partition(".")[0] in EXTRAS]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(str(folder))


def test_a_run_needs_no_extra_and_names_the_one_of_the_page(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, damaged_box.JOB.replace("report: none\n", ""))
    result = damageest.run(job, output=tmp_path / "out")
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.02)
    assert any("'damageest[report]'" in str(warning) for warning in result.warnings)
    assert (tmp_path / "out" / "damage" / "site-1.stl").is_file()
    assert not (tmp_path / "out" / "report.html").exists()


def test_the_method_of_the_paper_names_its_extra(tmp_path: Path) -> None:
    job = damaged_box.write_small(tmp_path, "method: surface\n")
    with pytest.raises(StageError, match=r"'damageest\[vtk\]'"):
        damageest.run(job)


def test_a_scan_in_a_format_of_an_extra_names_it(tmp_path: Path) -> None:
    job = damaged_box.write_small(tmp_path)
    (tmp_path / "scan.vtk").write_text(
        "# vtk DataFile Version 3.0\nscan\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n"
    )
    (tmp_path / "scan.e57").write_bytes(make_e57_header())
    for name, extra in (("scan.vtk", "vtk"), ("scan.e57", "e57")):
        with pytest.raises(StageError, match=rf"damageest\[{extra}\]"):
            damageest.run(job, settings=[f"scan={name}"])


def make_e57_header() -> bytes:
    """As much of a file as is read before the library is asked."""
    header = b"ASTM-E57" + np.array([1, 0], "<u4").tobytes() + np.array([1024, 48, 8, 1024], "<u8").tobytes()
    return header + bytes(1024 - len(header))

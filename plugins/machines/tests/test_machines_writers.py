"""Programs for machines, read back by readers of the test, and by those of others where there are any."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from machine_checks import PAIRS, STRAIGHT, compare, read, write

from damageest.artefacts import DepositPath, Mesh
from tests.path_shapes import corner, dent, plan

ROOT = Path(__file__).parents[3]
PARSER = Path(os.environ.get("DAMAGEEST_REAL_DATA", ROOT.parent / "shared" / "data")).parent / "controllers"


@cache
def make_path(kind: str) -> DepositPath:
    if kind == "straight":
        path = plan(dent(), simulate=False, direction=(0.0, 0.0, 1.0))
    else:
        path = plan(corner(), simulate=False, direction=(0.6, 0.48, 0.64), axes=5)
    power = np.where(path.layer == 1, 1500.0, 1200.0)
    values = np.stack([power, np.full(len(power), 12.5)], axis=1)
    starts = np.flatnonzero(~path.on[:-1] & path.on[1:])[1::3]
    dwell = np.zeros(len(path.points))
    dwell[starts] = 7.25 + np.arange(len(starts))
    return replace(path, channels=("power", "gas"), values=values, dwell=dwell)


@pytest.mark.variants(1)
@pytest.mark.parametrize(("form", "machine"), [*PAIRS, *STRAIGHT])
@pytest.mark.parametrize("kind", ["straight", "tilted"])
def test_the_control_would_follow_the_path(form: str, machine: str, kind: str, tmp_path: Path) -> None:
    """Points, tool axes, speeds, process and channels."""
    if kind == "tilted" and (form, machine) in STRAIGHT:
        pytest.skip("3 axes")
    path = make_path(kind)
    text, _ = write(form, machine, path, tmp_path)
    off = compare(path, read(form, machine, text))
    assert off.point < 1e-3
    assert off.axis < 1e-3
    assert off.feed < 1e-2  # some controls take a tenth of a millimetre a second


@pytest.mark.parametrize(("unit", "factor"), [("in", 25.4), ("m", 1000.0), ("um", 1e-3)])
def test_units_of_the_job(unit: str, factor: float, tmp_path: Path) -> None:
    path = make_path("straight")
    assert path.around is not None
    here = replace(
        path, points=path.points / factor, feed=path.feed / factor, standoff=path.standoff / factor,
        nozzle=Mesh(path.nozzle.vertices / factor, path.nozzle.faces), around=path.around / factor,
    )  # fmt: skip
    text, _ = write("krl", "kuka", here, tmp_path, unit)
    assert compare(here, read("krl", "kuka", text), factor).point < 1e-3
    assert text == write("krl", "kuka", path, tmp_path)[0]


@pytest.mark.parametrize(("form", "machine"), [*PAIRS, *STRAIGHT])
def test_the_same_path_gives_the_same_bytes(form: str, machine: str, tmp_path: Path) -> None:
    path = make_path("straight")
    assert write(form, machine, path, tmp_path) == write(form, machine, path, tmp_path)


@pytest.mark.skipif(shutil.which("rs274") is None, reason="LinuxCNC's interpreter rs274 (linuxcnc-uspace) is missing")
@pytest.mark.parametrize(("machine", "kind"), [("3_axes", "straight"), ("table_table", "tilted")])
def test_linuxcnc_reads_its_programs(machine: str, kind: str, tmp_path: Path) -> None:
    """By its own interpreter: each move, at the same place, with the output for the process as often as there are
    passes."""
    path = make_path(kind)
    text, _ = write("linuxcnc", f"linuxcnc_{machine}", path, tmp_path)
    (tmp_path / "a.ngc").write_text(text)
    (tmp_path / "tools.tbl").write_text("T1 P1 D10 Z150\n")
    found = subprocess.run(
        ["rs274", "-g", "-t", "tools.tbl", "a.ngc"], cwd=tmp_path, capture_output=True, text=True, check=False
    ).stdout
    moves = re.findall(r"STRAIGHT_(?:FEED|TRAVERSE)\((.*?)\)", found)
    words = re.findall(r"^(?:G\d+ )*X(\S+) Y(\S+) Z(\S+)", text, re.MULTILINE)
    assert "PROGRAM_END" in found
    assert path.dwell is not None
    waits = [float(word) for word in re.findall(r"DWELL\(([\d.]+)\)", found)]
    assert set(path.dwell[path.dwell > 0]) <= set(waits)
    assert found.count("SET_AUX_OUTPUT_BIT(0)") == found.count("CLEAR_AUX_OUTPUT_BIT(0)") == path.passes
    assert found.count("SET_AUX_OUTPUT_VALUE(0,") == len(np.unique(path.layer[path.on] == 1))
    places = np.array([[float(word) for word in move.split(",")[:3]] for move in moves])
    expected = np.array(words, float)
    homes = text.count("G53")
    inner = places[homes // 2 : len(places) - homes // 2]
    assert inner.shape == expected.shape
    assert np.abs(inner - expected).max() < 1e-4


@pytest.mark.slow
@pytest.mark.skipif(not (PARSER / "krl_check.py").is_file(), reason=f"no parser of KRL in {PARSER}")
@pytest.mark.parametrize("machine", [pytest.param("kuka", marks=pytest.mark.slow), "kuka_positioner"])
def test_a_parser_of_krl_by_others_takes_the_program(machine: str, tmp_path: Path) -> None:
    text, _ = write("krl", machine, make_path("tilted"), tmp_path)
    (tmp_path / "a.src").write_text(text)
    (tmp_path / "wrong.src").write_text(text.replace("LIN {X", "LINE {X", 1))
    command = [sys.executable, str(PARSER / "krl_check.py")]
    command += ["a.src", "wrong.src"]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert found.stdout.startswith("a.src: 0 syntax errors\n"), found.stderr
    assert re.search(r"wrong\.src: [1-9]", found.stdout)
    assert found.returncode


WAITS = {
    "krl": r"^WAIT SEC ([\d.]+)$", "rapid": r"^\s*WaitTime ([\d.]+);$", "fanuc": r"WAIT ([\d.]+)\(sec\)",
    "sinumerik": r"G4 F([\d.]+)$", "heidenhain": r"CYCL DEF 9.1 DWELL ([\d.]+)$", "linuxcnc": r"^G4 P([\d.]+)$",
}  # fmt: skip


@pytest.mark.parametrize(("form", "machine"), PAIRS)
def test_the_tool_waits_before_passes_beside_hot_beads(form: str, machine: str, tmp_path: Path) -> None:
    """Each wait comes once, with the process off; points and process are as without, and the time is longer by it."""
    path = make_path("tilted")
    assert path.dwell is not None
    waits = path.dwell[path.dwell > 0]
    plain, _ = write(form, machine, replace(path, dwell=None), tmp_path)
    text, _ = write(form, machine, path, tmp_path)
    found, short = (
        [float(word) for word in re.findall(WAITS[form], each.replace("\r", ""), re.MULTILINE)]
        for each in (text, plain)
    )
    assert sorted(set(found) - set(short)) == waits.tolist()
    assert len(found) == len(short) + len(waits) > len(short)
    off = compare(path, read(form, machine, text))
    assert off.point < 1e-3
    if form != "fanuc":  # its comments are short
        assert minutes(text) == pytest.approx(minutes(plain) + waits.sum() / 60, abs=0.11)


def minutes(text: str) -> float:
    found = re.search(r"about ([\d.]+) min", text)
    assert found
    return float(found.group(1))

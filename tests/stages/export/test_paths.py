"""Files of deposition paths, read by others: G-code by pygcode, APT by a small parser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import DepositPath, Floats, Solid
from damageest.errors import StageError
from damageest.geometry.transforms import invert_pose
from damageest.output.folder import OutputFolder
from damageest.registry import Registry
from damageest.stages.export import PathSettings
from damageest.stages.export.path_apt import write_apt
from damageest.stages.export.path_csv import HEAD, write_csv
from damageest.stages.export.rs274 import write_rs274
from tests.path_shapes import corner, dent, plan
from tests.stages.export import results

SETTINGS = PathSettings("mm", "block site 1")


@cache
def make_path(tilted: bool) -> DepositPath:
    if tilted:
        return plan(corner(), simulate=False, direction=(0.6, 0.48, 0.64), axes="3+2")
    return plan(dent(), simulate=False, direction=(0.0, 0.0, 1.0))


def read_csv(file: Path) -> Floats:
    lines = file.read_text().splitlines()
    assert lines[0] == f"{HEAD},dwell"
    return np.array([[float(word) for word in line.split(",")[:13]] for line in lines[1:]])


def read_apt(text: str) -> Floats:
    """x, y, z, i, j, k, feed (0: rapid) and on of every GOTO."""
    rows, feed, on = [], 0.0, 0.0
    assert text.index("RAPID") < text.index("GOTO")
    for line in text.splitlines():
        word, _, rest = line.partition("/")
        if word == "FEDRAT":
            feed = float(rest.split(",")[0])
        elif line.startswith("INSERT/DEPOSIT"):
            on = float(line.endswith("ON"))
        elif word == "GOTO":
            rows.append([*map(float, rest.split(",")), feed, on])
    return np.array(rows)


def read_blocks(text: str) -> Floats:
    """x, y, z, A, C, feed and on of every G0 and G1, by pygcode; words are kept until they change."""
    from pygcode import Line

    state = dict.fromkeys("XYZACF", 0.0)
    on, rows = 0.0, []
    for source in text.splitlines():
        if source.startswith("G43.4"):  # the control's own code, which RS-274 leaves to the maker
            continue
        line = Line(source)
        for code in line.block.gcodes:
            state |= {letter: float(value) for letter, value in code.get_param_dict().items() if letter in state}
            if str(code.word) == "M03":
                on = 1.0
            elif str(code.word) == "M05":
                on = 0.0
            elif code.word_letter == "F":
                state["F"] = float(code.word.value)
        if any(str(code.word) in ("G00", "G01") for code in line.block.gcodes):
            rows.append([*(state[letter] for letter in "XYZACF"), on])
    return np.array(rows)


@pytest.mark.variants(1)
@pytest.mark.parametrize("tilted", [False, True])
def test_the_apt_gives_the_points_of_the_csv(tilted: bool, tmp_path: Path) -> None:
    path = make_path(tilted)
    write_csv(tmp_path / "a.csv", path, SETTINGS)
    write_apt(tmp_path / "a.apt", path, SETTINGS)
    table, text = read_csv(tmp_path / "a.csv"), (tmp_path / "a.apt").read_text()
    found = read_apt(text)
    assert found[0, 6] == 0
    assert np.abs(np.delete(found - table[:, :8], 6, axis=1)).max() < 1e-6
    assert np.abs((found - table[:, :8])[1:]).max() < 1e-6
    assert (table[:, 11] == path.width).all()
    sizes = path.bead_sizes
    heights = path.heights[path.part - 1] if sizes is None else sizes[:, 1]
    assert np.allclose(table[:, 12], heights, rtol=1e-5)
    assert np.abs(table[:, :3] - path.points).max() < 1e-6
    assert text.startswith("PARTNO BLOCK SITE 1\nUNITS/MM\n")
    assert "LOADTL/1" in text
    assert text.endswith("FINI\n")


@pytest.mark.parametrize("tilted", [False, True])
def test_the_gcode_gives_the_points_of_the_csv(tilted: bool, tmp_path: Path) -> None:
    path = make_path(tilted)
    write_csv(tmp_path / "a.csv", path, SETTINGS)
    write_rs274(tmp_path / "a.ngc", path, SETTINGS)
    table, text = read_csv(tmp_path / "a.csv"), (tmp_path / "a.ngc").read_text()
    found = read_blocks(text)
    assert np.abs(found[:, :3] - table[:, :3]).max() < 2e-5
    assert found[1:, 5] == pytest.approx(table[1:, 6], rel=1e-4)
    assert [line for line in text.splitlines() if line.startswith("G0 ")] == [
        line for line in text.splitlines() if line.startswith(("G0 ", "G1 "))
    ][:1]
    assert (found[:, 6] == table[:, 7]).all()
    a, c = np.radians(found[:, 3]), np.radians(found[:, 4])
    axes = np.column_stack([np.sin(a) * np.sin(c), -np.sin(a) * np.cos(c), np.cos(a)])
    assert np.abs(axes - table[:, 3:6]).max() < 2e-6
    assert ("G43.4" in text) == tilted
    assert "G21" in text
    assert text.endswith("M2\n")


def test_inches_and_metres(tmp_path: Path) -> None:
    path = make_path(False)
    write_rs274(tmp_path / "in.ngc", path, replace(SETTINGS, unit="in"))
    assert "G20" in (tmp_path / "in.ngc").read_text()
    write_rs274(tmp_path / "m.ngc", path, replace(SETTINGS, unit="m"))
    assert np.abs(read_blocks((tmp_path / "m.ngc").read_text())[:, :3] - 1000 * path.points).max() < 2e-5
    write_apt(tmp_path / "ft.apt", path, replace(SETTINGS, unit="ft"))
    text = (tmp_path / "ft.apt").read_text()
    assert "UNITS/INCHES" in text
    assert np.abs(read_apt(text)[:, :3] - 12 * path.points).max() < 2e-6


def test_templates_and_options(tmp_path: Path) -> None:
    told = replace(SETTINGS, header="(begin $title)\n$units G54", footer="M30", options={"on": "M100", "off": "M101"})
    write_rs274(tmp_path / "a.ngc", make_path(False), told)
    lines = (tmp_path / "a.ngc").read_text().splitlines()
    assert lines[1:3] == ["(begin block site 1)", "G21 G54"]
    assert lines[-1] == "M30"
    assert lines.count("M100") == lines.count("M101") == make_path(False).passes


def test_the_templates_of_a_job_get_title_units_and_site(tmp_path: Path, registry: Registry) -> None:
    (tmp_path / "head").write_text("(of $title)\n$units\nO${site}00\n")
    (tmp_path / "tail").write_text("M30 (end of site $site)\n")
    result = results.make()
    sites = tuple(replace(site, path=make_path(False)) for site in result.sites)
    cls = registry.get("export", "files").cls
    export: Any = cls(paths=["rs274"], path_header=tmp_path / "head", path_footer=tmp_path / "tail")
    export.run(replace(result, sites=sites), tmp_path, registry.writers, registry.path_writers)
    for site in (1, 2):
        lines = (tmp_path / f"path/site-{site}.ngc").read_text().splitlines()
        assert lines[1:4] == [f"(of two site {site})", "G21", f"O{site}00"]
        assert lines[-1] == f"M30 (end of site {site})"


def test_rotary_axes_b_and_c(tmp_path: Path) -> None:
    path = make_path(True)
    write_rs274(tmp_path / "a.ngc", path, replace(SETTINGS, options={"rotary": "BC"}))
    pairs = re.findall(r"B([-\d.]+) C([-\d.]+)", (tmp_path / "a.ngc").read_text())
    b, c = np.radians(np.array(pairs, float)).T
    axes = np.column_stack([np.sin(b) * np.cos(c), np.sin(b) * np.sin(c), np.cos(b)])
    assert np.abs(axes - path.axes).max() < 2e-6


def test_a_tilted_tool_without_rotary_axes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StageError, match="not along z"):
        write_rs274(tmp_path / "a.ngc", make_path(True), replace(SETTINGS, options={"rotary": "none"}))
    with pytest.raises(StageError, match="no option colour"):
        write_rs274(tmp_path / "a.ngc", make_path(True), replace(SETTINGS, options={"colour": "red"}))


def test_three_axes_are_written_in_a_set_up_frame(tmp_path: Path, registry: Registry) -> None:
    """The tool is along z in every file, and the transform that is written takes the path of the part's frame there."""
    path = plan(corner(), simulate=False, direction=(0.6, 0.48, 0.64))
    result = results.make()
    cls = registry.get("export", "files").cls
    sites = (replace(result.sites[0], path=path), *result.sites[1:])
    cls(frame="both").run(replace(result, sites=sites), tmp_path, registry.writers, registry.path_writers)
    told = json.loads((tmp_path / "path/site-1.setup.json").read_text())
    T = np.array(told["transform"])
    assert np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() < 1e-12
    table = read_csv(tmp_path / "path/site-1.csv")
    assert np.abs(table[:, :3] - (path.points @ T[:3, :3].T + T[:3, 3])).max() < 1e-6
    assert np.allclose(table[:, 3:6], [0, 0, 1])
    text = (tmp_path / "path/site-1.ngc").read_text()
    assert "G43.4" not in text
    assert not re.search(r"^G[01].*[ABC]", text, re.MULTILINE)
    # the scan's folder has the same program, and its own transform
    assert read_csv(tmp_path / "scan_frame/path/site-1.csv") == pytest.approx(table)
    other = np.array(json.loads((tmp_path / "scan_frame/path/site-1.setup.json").read_text())["transform"])
    assert np.allclose(other @ invert_pose(result.pose), T)


def test_a_path_is_read_again_with_what_it_does_not_reach_and_its_tool(tmp_path: Path, registry: Registry) -> None:
    path = make_path(False)
    assert path.missing is not None
    assert path.tightest is not None
    result = results.make()
    cls = registry.get("export", "files").cls
    sites = (replace(result.sites[0], path=path), *result.sites[1:])
    cls(frame="both", paths=("csv",)).run(
        replace(result, sites=sites), tmp_path, registry.writers, registry.path_writers
    )
    for place, T in (("", np.eye(4)), ("scan_frame", invert_pose(result.pose))):
        folder = OutputFolder(tmp_path / place, {"sites": [{"id": 1}], "units": "mm"})
        read, unreached = folder.read_path(1), folder.read_mesh("path/site-1.unreached.ply")
        tool = folder.read_mesh("path/site-1.tool.ply")
        assert read is not None
        assert unreached is not None
        assert tool is not None
        assert np.abs(read.points - (path.points @ T[:3, :3].T + T[:3, 3])).max() < 1e-5
        assert (read.on == path.on).all()
        assert read.layer.max() == path.layers
        assert Solid(unreached.vertices, unreached.faces).volume == pytest.approx(path.unreached_volume, rel=1e-3)
        point = T[:3, :3] @ path.tightest[0] + T[:3, 3]
        # the beam ends at the bead, half a bead's width round the point
        assert np.linalg.norm(tool.vertices - point, axis=1).min() == pytest.approx(path.width / 2, rel=1e-6)


@pytest.mark.parametrize("rotary", ["AC", "BC"])
def test_a_table_that_turns_brings_each_point_under_the_tool(rotary: str, tmp_path: Path) -> None:
    """By the kinematics of the table, from the program's words: part = pivot + Rz(C) R(A or B) (machine - pivot)."""
    from scipy.spatial.transform import Rotation

    path, pivot = make_path(True), np.array([5.0, -3.0, 12.0])
    options = {"tcp": "table", "rotary": rotary, "pivot": "5 -3 12", "power": "900", "work_offset": "G55"}
    write_rs274(tmp_path / "a.ngc", path, replace(SETTINGS, options=options))
    text = (tmp_path / "a.ngc").read_text()
    words = re.findall(r"^G[01] X(\S+) Y(\S+) Z(\S+) [AB](\S+) C(\S+)", text, re.MULTILINE)
    rows = np.array(words, float)
    turn = Rotation.from_euler("z", rows[:, 4:], degrees=True) * Rotation.from_euler(
        "x" if rotary == "AC" else "y", rows[:, 3:4], degrees=True
    )
    points = pivot + turn.apply(rows[:, :3] - pivot)
    assert np.linalg.norm(path.points[:, None] - points[None], axis=2).min(axis=1).max() < 1e-4
    assert np.abs(turn.apply([0, 0, 1.0])[-1] - path.axes[-1]).max() < 1e-6
    assert "M3 S900" in text
    assert "G21 G55" in text
    assert text.index("G93") < text.index("M3 S900") < text.index("G94\nM2")


@pytest.mark.skipif(shutil.which("rs274") is None, reason="LinuxCNC's interpreter rs274 (linuxcnc-uspace) is missing")
@pytest.mark.parametrize("tcp", ["none", "table", "machine"])
def test_linuxcnc_reads_the_program(tcp: str, tmp_path: Path) -> None:
    path = make_path(tcp != "none")
    options = {} if tcp == "none" else {"tcp": tcp, "power": "1000"}
    write_rs274(tmp_path / "a.ngc", path, replace(SETTINGS, options=options))
    found = subprocess.run(["rs274", "-g", "a.ngc"], cwd=tmp_path, capture_output=True, text=True, check=False).stdout
    moves = [line for line in (tmp_path / "a.ngc").read_text().splitlines() if line.startswith(("G0 ", "G1 "))]
    assert found.count("STRAIGHT_FEED(") == len(moves) - 1 >= len(path.points) - 1
    assert found.count("STRAIGHT_TRAVERSE(") == 1
    assert "PROGRAM_END" in found
    assert found.count("START_SPINDLE_CLOCKWISE(") == path.passes


@pytest.mark.parametrize(("option", "value"), [("tcp", "maybe"), ("pivot", "1 2")])
def test_words_that_are_wrong_are_refused(option: str, value: str, tmp_path: Path) -> None:
    with pytest.raises(StageError, match=f"{option} is '{value}'"):
        write_rs274(tmp_path / "a.ngc", make_path(True), replace(SETTINGS, options={"tcp": "table", option: value}))

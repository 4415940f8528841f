"""Writes 20 paths in every format for every shipped machine, reads all back, and prints a table in Markdown.

    python -m measure_machines [PATHS [SEED]]          (in plugins/machines/tests, with the repository on PYTHONPATH)

Parts, settings and units are drawn from the seed. What a machine refuses is counted, with its reason: that is no error.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from damageest_machines.lazy import list_writers
from machine_checks import PAIRS, STRAIGHT, compare, read, write
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Floats, Mesh
from damageest.errors import StageError
from damageest.stages.export import PathSettings
from damageest.stages.export._paths import _move_path
from damageest.stages.export.path_apt import write_apt
from damageest.stages.export.path_csv import write_csv
from tests.path_shapes import BLOCK, Loss, corner, cut, dent, plan, slot

PARSER = Path(os.environ.get("DAMAGEEST_REAL_DATA", "")).parent / "controllers" / "krl_check.py"
UNITS = {"mm": 1.0, "in": 25.4, "cm": 10.0}
PROCESS = [
    {"set": {"power": 1200.0, "powder": 9.0, "gas": 12.0}},
    {"layer": 1, "set": {"power": 1500.0}},
    {"kind": "contour", "set": {"power": 1000.0, "speed": 480.0}},
    {"first": True, "set": {"powder": 11.0}},
]


def draw_loss(rng: np.random.Generator) -> Loss:
    """A dent, corner or slot, or a ball or box that bites into the block at a random place of its skin."""
    kind = rng.integers(5)
    if kind < 3:
        return (dent, corner, slot)[kind]()
    place = rng.uniform([-15, -10, -2], [15, 10, 3])
    if kind == 3:
        return cut(BLOCK, Manifold.sphere(rng.uniform(7, 11), 48).translate(tuple(place)))
    return cut(BLOCK, Manifold.cube((18, 12, 14), True).rotate((0, 0, rng.uniform(0, 90))).translate(tuple(place)))


def draw_path(seed: int) -> tuple[DepositPath, str]:
    """A path, and the unit that its lengths are in; points as a job would have them in this unit."""
    rng = np.random.default_rng(seed)
    loss = draw_loss(rng)
    axes: Any = (3, "3+2", 5, 5)[int(rng.integers(4))]
    direction = np.array([*rng.uniform(-0.6, 0.6, 2), 1.0])
    path = plan(
        loss, simulate=False, layers="auto", axes=axes,
        width=float(rng.uniform(3, 4.5)), height=float(rng.uniform(1.4, 2.2)),
        direction=tuple(direction if axes != 3 else [0.0, 0.0, 1.0]), overlap=float(rng.uniform(0.2, 0.4)),
        pattern=str(rng.choice(["zigzag", "contour", "spiral", "offset-zigzag"])), process=PROCESS,
    )  # fmt: skip
    path = _move_path(path, None)
    unit = str(rng.choice(list(UNITS)))
    factor = UNITS[unit]
    assert path.around is not None
    return replace(
        path, points=path.points / factor, feed=path.feed / factor, standoff=path.standoff / factor,
        width=path.width / factor, heights=path.heights / factor,
        nozzle=Mesh(path.nozzle.vertices / factor, path.nozzle.faces), around=path.around / factor,
    ), unit  # fmt: skip


def check_table(rows: Floats, path: DepositPath, factor: float) -> tuple[float, float]:
    """The largest differences of points in mm and of tool axes in degrees; the process is compared too."""
    assert len(rows) == len(path.points)
    assert (rows[:, 6].astype(bool) == path.on).all()
    turns = 2 * np.arcsin(np.clip(np.linalg.norm(rows[:, 3:6] - path.axes, axis=1) / 2, 0, 1))
    return float(np.abs(rows[:, :3] - path.points).max()) * factor, float(np.degrees(turns.max()))


def read_neutral(form: str, path: DepositPath, unit: str, folder: Path) -> tuple[float, float]:
    assert path.values is not None
    file, settings = folder / "neutral", PathSettings(unit, "a site 1", machine="kuka_positioner")
    if form == "csv":
        write_csv(file, path, settings)
        lines = [line.split(",") for line in file.read_text().splitlines()]
        rows = np.array([[float(word) for word in [*line[:6], line[7]]] for line in lines[1:]])
        values = np.array([[float(word) for word in line[14:-1]] for line in lines[1:]])
        assert np.allclose(values, path.values)
        return check_table(rows, path, UNITS[unit])
    if form == "json":
        import json

        list_writers()["json"].write(file, path, settings)
        found = json.loads(file.read_text())["path"]
        rows = np.column_stack([found["point"], found["axis"], found["on"]])
        assert np.allclose(found["values"], path.values)
        return check_table(rows, path, UNITS[unit])
    write_apt(file, path, settings)
    on, listed = 0.0, []
    for line in file.read_text().splitlines():
        on = float(line.endswith("ON")) if line.startswith("INSERT/DEPOSIT") else on
        if line.startswith("GOTO/"):
            listed.append([*map(float, line[5:].split(",")), on])
    rows, factor = np.array(listed), 1.0 if unit == "in" else UNITS[unit]
    rows[:, :3] /= factor
    return check_table(rows, path, UNITS[unit])


def accept(form: str, text: str, folder: Path) -> str:
    """What a reader by others says: empty for nothing wrong, "-" without a reader."""
    if form == "linuxcnc" and shutil.which("rs274"):
        (folder / "a.ngc").write_text(text)
        (folder / "tools.tbl").write_text("T1 P1 D10 Z150\n")
        command = ["rs274", "-g", "-t", "tools.tbl", "a.ngc"]
        said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stdout
        moves = len(re.findall(r"STRAIGHT_(?:FEED|TRAVERSE)\(", said))
        homes = text.count("G53 ")
        wanted = len(re.findall(r"^(?:G\d+ )*X\S+ Y\S+ Z", text, re.MULTILINE)) + homes
        return "" if moves == wanted and "PROGRAM_END" in said else f"{moves} of {wanted} moves"
    if form == "krl" and PARSER.is_file():
        (folder / "a.src").write_text(text)
        command = [sys.executable, str(PARSER), "a.src"]
        said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stdout
        return "" if said == "a.src: 0 syntax errors\n" else said
    return "-"


def main(paths: int = 20, seed: int = 1) -> None:
    drawn = []
    for k in range(paths):
        before = time.process_time()
        path, unit = draw_path(seed + k)
        tilted = float(np.degrees(np.arccos(np.clip(path.axes[:, 2].min(), -1, 1))))
        print(f"path {k + 1}: {len(path.points)} moves, {path.passes} passes, tilt {tilted:.0f}, {unit}, "
              f"{time.process_time() - before:.1f} s", file=sys.stderr, flush=True)  # fmt: skip
        drawn.append((path, unit))
    print("| format | machine | programs | refused | moves | points, mm | axes, degrees | speeds | read by others |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |")
    folder = Path(tempfile.mkdtemp())
    for form in ("csv", "apt", "json"):
        off = np.max([read_neutral(form, path, unit, folder) for path, unit in drawn], axis=0)
        moves = sum(len(path.points) for path, _ in drawn)
        print(f"| {form} | – | {len(drawn)} | 0 | {moves} | {off[0]:.1e} | {off[1]:.1e} | – | – |", flush=True)
    for form, machine in [*PAIRS, *STRAIGHT]:
        refused: Counter[str] = Counter()
        worst, moves, done, said = np.zeros(3), 0, 0, []
        for path, unit in drawn:
            try:
                text, _ = write(form, machine, path, folder, unit)
            except StageError as error:
                refused[" ".join(error.message.split()[:9])] += 1
                continue
            found = read(form, machine, text)
            worst = np.maximum(worst, compare(path, found, UNITS[unit]))
            moves, done = moves + len(found.points), done + 1
            said.append(accept(form, text, folder))
        others = "–" if set(said) <= {"-"} else f"{sum(not one for one in said)} of {len(said)}"
        print(f"| {form} | {machine} | {done} | {refused.total()} | {moves} | {worst[0]:.1e} | {worst[1]:.1e} | "
              f"{worst[2]:.1e} | {others} |", flush=True)  # fmt: skip
        for reason, count in refused.items():
            print(f"  {machine}: {count} x {reason}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

"""Compares what a control would do with the path that it was given."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from damageest_machines.files import find_file
from damageest_machines.lazy import list_writers
from machine_readers import READERS, Read
from ruamel.yaml import YAML

from damageest.artefacts import DepositPath
from damageest.stages.export import PathSettings

PAIRS = [
    ("krl", "kuka"), ("krl", "kuka_positioner"), ("rapid", "abb"), ("fanuc", "fanuc_positioner"),
    ("sinumerik", "sinumerik_table_table"), ("sinumerik", "sinumerik_head_head"),
    ("heidenhain", "heidenhain_head_table"), ("linuxcnc", "linuxcnc_table_table"),
]  # fmt: skip
"""Formats, with machines that turn the tool or the part."""
STRAIGHT = [("sinumerik", "sinumerik_3_axes"), ("linuxcnc", "linuxcnc_3_axes")]


class Off(NamedTuple):
    """The largest differences: of points in mm, of tool axes in degrees, of speeds as a share."""

    point: float
    axis: float
    feed: float


def write(form: str, machine: str | Path, path: DepositPath, folder: Path, unit: str = "mm") -> tuple[str, list[str]]:
    """The program's text, and what the user is told."""
    writer = list_writers()[form]
    file = folder / f"site-1.{writer.suffix}"
    notes = writer.write(file, path, PathSettings(unit, "block site 1", machine=machine))
    return file.read_bytes().decode("ascii"), list(notes or ())


def read(form: str, machine: str | Path, text: str) -> Read:
    return READERS[form](text, load(machine))


@cache
def load(machine: str | Path) -> dict[str, Any]:
    values: dict[str, Any] = YAML(typ="safe").load(find_file(machine))
    return values


def compare(path: DepositPath, found: Read, factor: float = 1.0) -> Off:
    """Follows the path: each of its points comes, in its order, with its tool axis, and between two of them nothing but
    places on the straight line, with the process as on the move of the path; or, after a pass, a way straight along the
    tool axis to where the tool may turn to all sides, and back. Raises AssertionError where not."""
    points = path.points * factor
    at, worst = 0, np.zeros(3)
    for k in range(len(points)):
        if k and path.on[k - 1] and not path.on[k]:
            at = _skip_way_out(path, found, k - 1, at, factor)
        start = at
        while True:
            assert at < len(found.points), f"move {k} of the path is missing"
            gap = float(np.linalg.norm(found.points[at] - points[k]))
            axis = np.degrees(2 * np.arcsin(min(float(np.linalg.norm(_unit(found.axes[at]) - path.axes[k])) / 2, 1.0)))
            if gap < 1e-3 and axis < 1e-3:
                break
            if k:  # a place between
                line = points[k] - points[k - 1]
                share = np.clip((found.points[at] - points[k - 1]) @ line / max(line @ line, 1e-300), 0, 1)
                aside = float(np.linalg.norm(points[k - 1] + share * line - found.points[at]))
                assert aside < 1e-3, f"{found.points[at]} is not on the way to move {k}"
            else:
                assert at == 0
            at += 1
        worst[:2] = np.maximum(worst[:2], [gap, axis])
        for j in range(start, at + 1):
            assert found.on[j] == bool(path.on[k]), f"process at move {k}"
            if k and path.on[k]:
                worst[2] = max(worst[2], abs(found.feed[j] / (path.feed[k] * factor) - 1))
                for number, name in enumerate(path.channels):
                    assert path.values is not None
                    assert abs(found.channels[j][name] - path.values[k, number]) < 1e-2
        at += 1
    assert not any(found.on[at:])
    assert len(found.points) - at <= 1  # the retract
    switched = np.flatnonzero(np.diff(np.array(found.on, int)))
    if any(found.exact):
        assert all(found.exact[j] for j in switched)
    return Off(*worst.tolist())


def _skip_way_out(path: DepositPath, found: Read, k: int, at: int, factor: float) -> int:
    """The number of the first point behind a way from point ``k`` of the path, straight along the tool axis, to where
    the tool may turn, and back; ``at``, where there is no such way."""
    start, axis = path.points[k] * factor, path.axes[k]
    out = np.asarray(found.points[at]) - start
    far = float(np.linalg.norm(out))
    if path.around is None or far < 1e-3 or float(np.linalg.norm(out / far - axis)) > 1e-5:
        return at
    tool = np.linalg.norm(path.nozzle.vertices + np.array([0.0, 0.0, path.standoff]), axis=1).max()
    if np.linalg.norm(found.points[at] / factor - path.around[:3]) < path.around[3] + tool - 1e-3:
        return at
    place = found.points[at]
    while np.linalg.norm(found.points[at] - place) < 1e-3:
        assert not found.on[at]
        at += 1
    assert np.linalg.norm(found.points[at] - start) < 1e-3
    assert np.linalg.norm(_unit(found.axes[at]) - axis) < 1e-4
    assert not found.on[at]
    return at + 1


def _unit(vector: Any) -> Any:
    return vector / np.linalg.norm(vector)

"""A deposition path to be played: which passes are laid at a time, and where the nozzle is."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh

COLUMNS = ("x", "y", "z", "i", "j", "k", "feed", "on", "layer")
"""Those of the table that are played."""


@dataclass(frozen=True, eq=False)
class PathPlay:
    """Points (N,3) on the top of the bead with the tool axis (N,3); ``on``: whether metal flows on the way to each;
    ``layer`` and ``minutes`` (N,), when each is reached."""

    points: Floats
    axes: Floats
    on: NDArray[np.bool_]
    layer: NDArray[np.int64]
    minutes: Floats

    @classmethod
    def read(cls, path: Path) -> PathPlay:
        """Reads the table that `export: {paths: csv}` writes, in the part's frame: where the build direction is not z,
        the table is in that of the set-up, and a file beside it has the transform."""
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
        table = {name: np.array([float(row[name]) for row in rows]) for name in COLUMNS}
        points = np.column_stack([table[name] for name in "xyz"])
        way = np.linalg.norm(np.diff(points, axis=0), axis=1)
        feed = np.maximum(table["feed"][1:], 1e-9)
        waits = np.array([float(row.get("dwell") or 0.0) for row in rows]) / 60
        minutes = np.concatenate([[0.0], np.cumsum(way / feed + waits[:-1])])
        axes = np.column_stack([table[name] for name in "ijk"])
        setup = path.with_name(f"{path.stem}.setup.json")
        if setup.is_file():
            back = np.linalg.inv(np.array(json.loads(setup.read_text())["transform"], float))
            points, axes = points @ back[:3, :3].T + back[:3, 3], axes @ back[:3, :3].T
        return cls(points, axes, table["on"] > 0, table["layer"].astype(np.int64), minutes)

    def at(self, share: float) -> int:
        """The number of the last point that is reached at a share of the time, 0 to 1."""
        return int(np.searchsorted(self.minutes, share * self.minutes[-1], side="right") - 1)

    def share_of_layer(self, layer: int) -> float:
        """The share of the time at which a layer is done."""
        last = np.flatnonzero(self.layer <= layer)
        return float(self.minutes[last[-1]] / max(self.minutes[-1], 1e-12)) if len(last) else 0.0

    def list_passes(self, end: int) -> tuple[list[Floats], list[int]]:
        """The pieces where metal flows, up to point ``end``, each with its layer."""
        pieces, layers = [], []
        on = self.on[: end + 1].astype(np.int8)
        starts = np.flatnonzero(np.diff(np.concatenate([[0], on])) == 1)
        ends = np.flatnonzero(np.diff(np.concatenate([on, [0]])) == -1)
        for first, last in zip(starts, ends, strict=True):
            pieces.append(self.points[max(first - 1, 0) : last + 1])
            layers.append(int(self.layer[first]))
        return pieces, layers


def make_nozzle(options: dict[str, Any], tip: Floats, axis: Floats) -> Mesh | None:
    """The nozzle of a job (a cone and a cylinder) with its tip at a place; None for one that is a mesh."""
    if "body_radius" not in options:
        return None
    radius, body = float(options.get("tip_radius") or 0.0), float(options["body_radius"])
    cone = (body - radius) / max(np.tan(np.radians(float(options.get("cone_angle", 30.0)))), 1e-6)
    cone = min(cone, float(options["length"]))
    rings = [(0.0, radius), (cone, body), (float(options["length"]), body)]
    turn = np.linspace(0, 2 * np.pi, 33)[:-1]
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    circle = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    vertices = np.concatenate([[tip], *(tip + height * axis + wide * circle for height, wide in rings)])
    count, faces = len(turn), []
    nearest = np.arange(count)
    follow = (nearest + 1) % count
    faces.append(np.column_stack([np.zeros(count, int), 1 + follow, 1 + nearest]))
    for ring in range(2):
        a, b = 1 + ring * count, 1 + (ring + 1) * count
        faces.append(np.column_stack([a + nearest, a + follow, b + follow]))
        faces.append(np.column_stack([a + nearest, b + follow, b + nearest]))
    return Mesh(vertices, np.concatenate(faces))

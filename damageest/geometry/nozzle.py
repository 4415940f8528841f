"""The tool that lays beads, placed to be shown: its nozzle and its beam."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import DepositPath, Floats, Mesh
from damageest.geometry.transforms import turn_to_axis

AROUND = 24
"""Sides of the beam."""


def place_tool(path: DepositPath, point: Floats, axis: Floats) -> tuple[Mesh, Mesh]:
    """Nozzle and beam of a path with the tool at a ``point`` (3,) on the top of a bead, along an ``axis`` (3,).

    The beam is as wide as the bead, from there to the nozzle's tip. The nozzle is empty where the path has none.
    """
    turn = turn_to_axis(axis)
    nozzle = Mesh(path.nozzle.vertices @ turn.T + point + path.standoff * axis, path.nozzle.faces)
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = path.width / 2 * np.stack([np.cos(angle), np.sin(angle), np.zeros(AROUND)], axis=1)
    places = np.concatenate([ring, ring + np.array([0.0, 0.0, path.standoff])])
    near, on = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    sides = [np.stack([near, on, on + AROUND], axis=1), np.stack([near, on + AROUND, near + AROUND], axis=1)]
    return nozzle, Mesh(places @ turn.T + point, np.concatenate(sides))

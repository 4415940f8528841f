"""Writes a deposition path as CSV: one row a move."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.artefacts import DepositPath
from damageest.stages.export import PathSettings

HEAD = "x,y,z,i,j,k,feed,on,layer,pass"


def write_csv(file: Path, path: DepositPath, settings: PathSettings) -> None:
    """Point (x, y, z), tool axis (i, j, k), feed in lengths a minute, on (1: the move to this point deposits), layer
    and pass. Lengths in the job's unit."""
    rows = [HEAD]
    columns = np.column_stack([path.points, path.axes, path.feed])
    for row, on, layer, number in zip(columns, path.on, path.layer, path.number, strict=True):
        text = ",".join(f"{value:.6f}" for value in row[:6] + 0.0)
        rows.append(f"{text},{row[6]:.6g},{int(on)},{layer},{number}")
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")

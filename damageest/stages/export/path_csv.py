"""Writes a deposition path as CSV: one row a move."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.artefacts import DepositPath
from damageest.stages.export import PathSettings

HEAD = "x,y,z,i,j,k,feed,on,layer,pass,part,width,height,kind"


def write_csv(file: Path, path: DepositPath, settings: PathSettings) -> None:
    """Point (x, y, z), tool axis (i, j, k), feed in lengths a minute, on (1: the move to this point deposits), layer,
    pass, part of the deposit, width and height of the bead, kind of the pass, a column for each channel of the
    process, and dwell (seconds at the point). Lengths in the job's unit."""
    rows = [",".join([HEAD, *path.channels, "dwell"])]
    values = np.empty((len(path.points), 0)) if path.values is None else path.values
    columns = np.column_stack([path.points, path.axes, path.feed, path.sizes, path.waits])
    numbers = np.column_stack([path.on, path.layer, path.number, path.part]).tolist()
    for row, (on, layer, number, part), given in zip(columns, numbers, values, strict=True):
        text = ",".join(f"{value:.6f}" for value in row[:6] + 0.0)
        kind = path.kinds[number - 1] if path.kinds else ""
        text += f",{row[6]:.6g},{on},{layer},{number},{part},{row[7]:.6g},{row[8]:.6g},{kind}"
        rows.append(",".join([text, *(f"{value:.6g}" for value in given), f"{row[9]:.3f}"]))
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")

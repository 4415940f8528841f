"""Writes the points of the scan with what was found of each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from damageest.artefacts import Scan
from damageest.io.meshes import write_points
from damageest.stages.export import ExportedFiles
from damageest.stages.export._colours import LABELLED

if TYPE_CHECKING:
    from damageest.result import Result

PointColours = Literal["label", "scan"]
COLOUR = ("red", "green", "blue")


def write_scan(result: Result, scan: Scan, folder: Path, name: str, point_colours: PointColours) -> ExportedFiles:
    """Writes the points of ``scan``, in its frame, with what was found of each, and with what the scanner's program
    wrote of it."""
    x, y, z = scan.points.T
    columns = {
        "x": x,
        "y": y,
        "z": z,
        "distance": result.deviation.distance.astype(np.float32),
        "label": result.deviation.label.astype(np.uint8),
        "site": result.site_label.astype(np.int32),
    }
    labelled = dict(zip(COLOUR, LABELLED[result.deviation.label].T, strict=True))
    if scan.colours is None:
        columns |= labelled
    elif point_colours == "scan":
        columns |= dict(zip(COLOUR, scan.colours.T, strict=True))
    else:
        columns |= {**labelled, **{f"scan_{name}": scan.colours[:, k] for k, name in enumerate(COLOUR)}}
    if scan.confidence is not None:
        columns["confidence"] = scan.confidence
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    write_points(folder / name, columns)
    return ExportedFiles((name,))

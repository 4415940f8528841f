"""PTX, a structured text format of laser scanners: range images in metres, each with its pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.artefacts import Bytes, Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import scale_colours
from damageest.io.points.text import parse_numbers

_HEAD = 10
"""Lines before the points of a scan: columns, rows, position, three axes, four rows of the transform."""


def read(path: Path, columns: str | None = None) -> PointFile:
    """The points of all scans in the common frame of the file, without those that have no return (0 0 0).

    The scanner position of a scan is the origin of its frame, moved by its transform; the last row is the translation.
    Where the header gives another position, it is not known which one holds: then the position is unknown.
    """
    lines = path.read_bytes().replace(b"\r\n", b"\n").split(b"\n")
    while lines and not lines[-1].strip():
        lines.pop()
    at = 0
    points: list[Floats] = []
    positions: list[Floats] = []
    numbers: list[int] = []
    notes: list[str] = []
    colours: list[Bytes | None] = []
    while at < len(lines):
        count, position, transform = _read_head(lines[at : at + _HEAD], len(points) + 1)
        rows = lines[at + _HEAD : at + _HEAD + count]
        if len(rows) < count:
            raise FormatError(f"the PTX file is truncated: scan {len(points) + 1} has {len(rows)} of {count} points")
        at += _HEAD + count
        table = _read_rows(rows, len(points) + 1)
        table = table[table[:, :3].any(axis=1)]
        colours.append(scale_colours(table[:, 4:7], 255) if table.shape[1] >= 7 else None)
        table = table[:, :3]
        placed = table @ transform[:3, :3] + transform[3, :3]
        reach = np.abs(placed - transform[3, :3]).max(initial=1e-9)
        is_known = bool(np.linalg.norm(position - transform[3, :3]) < 1e-3 * reach)
        if not is_known:
            notes.append(
                f"scan {len(points) + 1}: its scanner position differs from its transform; it counts as unknown"
            )
        numbers.append(len(points) if is_known else -1)
        positions.append(transform[3, :3])
        points.append(placed)
    if not points:
        raise FormatError("the PTX file has no scans")
    if len(points) > 1:
        notes.append(f"{len(points)} scans in one PTX file")
    some = any(number >= 0 for number in numbers)
    known = [colour for colour in colours if colour is not None]
    return PointFile(
        np.concatenate(points),
        unit="m",
        notes=tuple(notes),
        viewpoints=np.array(positions) if some else None,
        view=np.repeat(numbers, [len(piece) for piece in points]) if some else None,
        colours=np.concatenate(known) if len(known) == len(colours) else None,
    )


def _read_head(lines: list[bytes], number: int) -> tuple[int, Floats, Floats]:
    """The number of points, the position (3,) and the transform (4,4) of a scan, as rows that are multiplied from the
    left."""
    fault = f"the header of scan {number} is not that of a PTX file: columns, rows, 4 lines of 3 and 4 of 4 numbers"
    try:
        columns, rows = (int(line) for line in lines[:2])
        values = [[float(word) for word in line.split()] for line in lines[2:]]
    except ValueError:
        raise FormatError(fault) from None
    if [len(row) for row in values] != [3] * 4 + [4] * 4 or columns < 1 or rows < 1:
        raise FormatError(fault)
    transform = np.array(values[4:])
    turn = transform[:3, :3]
    if not np.isfinite(transform).all() or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3):
        raise FormatError(f"the transform of scan {number} of the PTX file is not rigid")
    return columns * rows, np.array(values[0]), transform


def _read_rows(rows: list[bytes], number: int) -> Floats:
    values = parse_numbers(b"\n".join(rows))
    width = len(rows[0].split())
    if width < 3 or len(values) != width * len(rows):
        raise FormatError(
            f"not all points of scan {number} of the PTX file have the same number of columns, at least 3"
        )
    return values.reshape(-1, width)

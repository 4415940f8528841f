"""PCD, the Point Cloud Library's format: ascii, binary and binary_compressed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Bytes, Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_confidence, find_unit
from damageest.io.points.text import parse_numbers

_KEYS = ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")


def _read_header(data: bytes) -> tuple[dict[str, list[str]], list[str], int]:
    """The lines by their first word, the comments, and the position of the data."""
    head: dict[str, list[str]] = {}
    comments: list[str] = []
    at = 0
    while "DATA" not in head:
        end = data.find(b"\n", at)
        if end < 0 or at > 65536:
            raise FormatError("the PCD header has no DATA line; not a PCD file, or truncated")
        words = data[at:end].decode("latin-1").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            comments.append(" ".join(words))
            continue
        if words[0].upper() not in _KEYS:
            raise FormatError(f"not a PCD file: its header has a line '{words[0][:40]}'")
        head[words[0].upper()] = words[1:]
    return head, comments, at


def read(path: Path, columns: str | None = None) -> PointFile:
    """The fields x, y, z and, if present, normal_x, normal_y, normal_z.

    The scanner position is the origin of a range image of a camera (HEIGHT above 1), else the VIEWPOINT. The default
    VIEWPOINT, 0 0 0 1 0 0 0, is found in files of any origin: then the position is not known.
    """
    data = path.read_bytes()
    head, comments, start = _read_header(data)
    try:
        names = head.get("FIELDS") or head["COLUMNS"]
        sizes = [int(s) for s in head["SIZE"]]
        counts = [int(c) for c in head.get("COUNT", ["1"] * len(names))]
        kinds = [{"F": "f", "I": "i", "U": "u"}[t.upper()] for t in head["TYPE"]]
        points = int(head["POINTS"][0]) if "POINTS" in head else int(head["WIDTH"][0]) * int(head["HEIGHT"][0])
        form = head["DATA"][0].lower()
        fields = [
            (f"{name}#{i}" if name == "_" else name, f"<{kind}{size}", (count,))
            for i, (name, size, kind, count) in enumerate(zip(names, sizes, kinds, counts, strict=True))
        ]
        kind = np.dtype(fields)
    except (KeyError, IndexError, ValueError, TypeError):
        raise FormatError("the PCD header is incomplete or inconsistent") from None
    if not {"x", "y", "z"} <= set(names):
        raise FormatError(f"the PCD file has no fields x, y, z; it has: {', '.join(names)}")
    if points < 0 or any(count < (name in "xyz") for name, count in zip(names, counts, strict=True)):
        raise FormatError("the PCD header gives a negative number, or no coordinates")
    if form == "ascii":
        table = _read_ascii(data[start:], points, sum(counts))
        offsets = dict(zip(names, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))

        def column(name: str) -> Floats:
            return table[:, offsets[name]]
    elif form == "binary":
        have = (len(data) - start) // kind.itemsize
        if have < points:
            raise FormatError(f"the PCD file is truncated: it has {have} of {points} points")
        rows = np.frombuffer(data, kind, points, start)

        def column(name: str) -> Floats:
            return rows[name][:, 0]
    elif form == "binary_compressed":
        blocks = _read_compressed(data, start, points, kind)

        def column(name: str) -> Floats:
            return blocks[name]
    else:
        raise FormatError(f"the PCD data format '{form}' is unknown; valid are ascii, binary and binary_compressed")

    def stack(*which: str) -> Floats:
        return np.column_stack([column(name).astype(np.float64) for name in which])

    wanted = ("normal_x", "normal_y", "normal_z")
    xyz = stack("x", "y", "z")
    confidence, packed = find_confidence(names), next((name for name in ("rgb", "rgba") if name in names), None)
    unit, said = find_unit(comments)
    position, notes = _find_viewpoint(head, xyz)
    return PointFile(
        xyz,
        stack(*wanted) if set(wanted) <= set(names) else None,
        notes=notes,
        viewpoints=None if position is None else position[None],
        view=None if position is None else np.zeros(len(xyz), np.int64),
        colours=None if packed is None else _unpack_colours(column(packed), kinds[names.index(packed)]),
        confidence=None if confidence is None else column(confidence).astype(np.float32),
        unit=unit,
        unit_said=said,
    )


def _unpack_colours(values: Any, kind: str) -> Bytes:
    """Colours (N,3) from the field rgb, whose four bytes are blue, green, red and transparency, also where it is called
    a floating-point number."""
    single = np.ascontiguousarray(values, np.float32 if kind == "f" else np.uint32)
    return (single.view(np.uint32)[:, None] >> np.array([16, 8, 0], np.uint32) & 255).astype(np.uint8)


def _find_viewpoint(head: dict[str, list[str]], points: Floats) -> tuple[Floats | None, tuple[str, ...]]:
    """The scanner position (3,), None where it is not known, and notes."""
    try:
        width, height = int(head["WIDTH"][0]), int(head["HEIGHT"][0])
        view = np.array([float(word) for word in head.get("VIEWPOINT", _NO_VIEW)])
    except (KeyError, IndexError, ValueError):
        return None, ()
    if view.shape != (7,) or not np.isfinite(view).all():
        return None, ()
    if height > 1 and width > 1 and width * height == len(points) and _is_range_image(points, width):
        return np.zeros(3), ("the PCD file is a range image; its origin is taken as the scanner position",)
    if np.array_equal(view, [float(word) for word in _NO_VIEW]):
        return None, ()
    note = "the VIEWPOINT of the PCD file is taken as the scanner position; it is not applied to the points"
    return view[:3], (note,)


_NO_VIEW = ["0", "0", "0", "1", "0", "0", "0"]


def _is_range_image(points: Floats, width: int) -> bool:
    """Whether rows of ``width`` points are an image of a camera at the origin that looks along z.

    Then x/z and y/z are linear in column and row, whatever the depth. The residual has to be below 0.2
    pixels, and the depth has to vary enough that a grid of another kind would have a residual of more than one.
    """
    finite = np.isfinite(points).all(axis=1) & (np.nan_to_num(points[:, 2]) > 0)
    index = np.flatnonzero(finite)
    if len(index) < 100:
        return False
    index = index[:: max(1, len(index) // 20_000)]
    x, y, z = points[index].T
    pixel = np.column_stack([index % width, index // width, np.ones(len(index))]).astype(np.float64)
    slope, *_ = np.linalg.lstsq(pixel, np.column_stack([x / z, y / z]), rcond=None)
    step = np.linalg.norm(slope[:2], axis=1)
    if not step.min() > 0:
        return False
    residual = np.sqrt((((pixel @ slope) - np.column_stack([x / z, y / z])) ** 2).mean())
    relief = z.std() / z.mean() * np.ptp(pixel[:, :2], axis=0).max() / 2
    return bool(residual < 0.2 * step.min() and relief > 1)


def _read_ascii(data: bytes, points: int, width: int) -> Floats:
    values = parse_numbers(data)
    if len(values) < points * width:
        raise FormatError(f"the PCD file is truncated: it has {len(values) // width} of {points} points")
    return values[: points * width].reshape(points, width)


def _read_compressed(data: bytes, start: int, points: int, kind: np.dtype[np.void]) -> dict[str, Floats]:
    """The columns of a block that is compressed by LZF and holds one field after the other."""
    packed, size = (int.from_bytes(data[start + k : start + k + 4], "little") for k in (0, 4))
    if size != points * kind.itemsize or len(data) < start + 8 + packed:
        raise FormatError("the compressed block of the PCD file is truncated, or differs in size from its header")
    block = _unpack_lzf(data[start + 8 : start + 8 + packed], size)
    columns, at = {}, 0
    for name in kind.names or ():
        field = kind[name]
        if not field.itemsize:
            continue
        columns[name] = np.frombuffer(block, field.base, points * field.itemsize // field.base.itemsize, at).reshape(
            points, -1
        )[:, 0]
        at += points * field.itemsize
    return columns


def _unpack_lzf(packed: bytes, size: int) -> bytes:
    """Decompresses LZF as defined by liblzf: runs of literals, and references to 3 bytes or more of earlier output."""
    out = bytearray()
    at, end = 0, len(packed)
    try:
        while at < end:
            control = packed[at]
            at += 1
            if control < 32:
                out += packed[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            back = len(out) - ((control & 31) << 8) - packed[at] - 1
            at += 1
            length += 2
            if back < 0 or len(out) + length > size:
                raise IndexError
            if back + length <= len(out):
                out += out[back : back + length]
            else:  # the reference overlaps its own output, which repeats periodically
                period = bytes(out[back:])
                out += (period * (length // len(period) + 1))[:length]
    except IndexError:
        raise FormatError("the compressed block of the PCD file is corrupt") from None
    if len(out) != size:
        raise FormatError("the compressed block of the PCD file is corrupt")
    return bytes(out)

"""PCD, the Point Cloud Library's format: ascii, binary and binary_compressed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.text import numbers

_KEYS = ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    head: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in head:
        end = data.find(b"\n", at)
        if end < 0 or at > 65536:
            raise FormatError("the PCD header has no DATA line; not a PCD file, or one cut short")
        words = data[at:end].decode("latin-1").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0].upper() not in _KEYS:
            raise FormatError(f"not a PCD file: its header has a line '{words[0][:40]}'")
        head[words[0].upper()] = words[1:]
    return head, at


def read(path: Path, columns: str | None = None) -> PointFile:
    """The fields x, y, z and, where there are any, normal_x, normal_y, normal_z."""
    data = path.read_bytes()
    head, start = _header(data)
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
        raise FormatError("the PCD header is incomplete or contradicts itself") from None
    if not {"x", "y", "z"} <= set(names):
        raise FormatError(f"the PCD file has no fields x, y, z; it has: {', '.join(names)}")
    if points < 0 or any(c < 1 for c in counts):
        raise FormatError("the PCD header gives a negative number")
    if form == "ascii":
        table = _ascii(data[start:], points, sum(counts))
        offsets = dict(zip(names, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))

        def column(name: str) -> Floats:
            return table[:, offsets[name]]
    elif form == "binary":
        have = (len(data) - start) // kind.itemsize
        if have < points:
            raise FormatError(f"the PCD file is cut short: {have} of {points} points are there")
        rows = np.frombuffer(data, kind, points, start)

        def column(name: str) -> Floats:
            return rows[name][:, 0]
    elif form == "binary_compressed":
        blocks = _compressed(data, start, points, kind)

        def column(name: str) -> Floats:
            return blocks[name]
    else:
        raise FormatError(f"PCD data '{form}' is unknown; it may be ascii, binary or binary_compressed")

    def stack(*which: str) -> Floats:
        return np.column_stack([column(name).astype(np.float64) for name in which])

    wanted = ("normal_x", "normal_y", "normal_z")
    view = head.get("VIEWPOINT", [])
    notes = (
        ("the PCD file's VIEWPOINT is not applied",)
        if view and view != _NO_VIEW and any(map(_nonzero, view[:3]))
        else ()
    )
    return PointFile(stack("x", "y", "z"), stack(*wanted) if set(wanted) <= set(names) else None, notes=notes)


_NO_VIEW = ["0", "0", "0", "1", "0", "0", "0"]


def _nonzero(word: str) -> bool:
    return word.strip("-+0.eE") != ""


def _ascii(data: bytes, points: int, width: int) -> Floats:
    values = numbers(data)
    if len(values) < points * width:
        raise FormatError(f"the PCD file is cut short: {len(values) // width} of {points} points are there")
    return values[: points * width].reshape(points, width)


def _compressed(data: bytes, start: int, points: int, kind: np.dtype[np.void]) -> dict[str, Floats]:
    """The columns of a block that stores one field after the other, packed by LZF."""
    packed, size = (int.from_bytes(data[start + k : start + k + 4], "little") for k in (0, 4))
    if size != points * kind.itemsize or len(data) < start + 8 + packed:
        raise FormatError("the PCD file's compressed block is cut short or not of the size its header says")
    block = _unpack_lzf(data[start + 8 : start + 8 + packed], size)
    columns, at = {}, 0
    for name in kind.names or ():
        field = kind[name]
        columns[name] = np.frombuffer(block, field.base, points * field.itemsize // field.base.itemsize, at).reshape(
            points, -1
        )[:, 0]
        at += points * field.itemsize
    return columns


def _unpack_lzf(packed: bytes, size: int) -> bytes:
    """LZF, as liblzf's description of the format has it: runs of literals, and references back of 3 bytes or more."""
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
            else:  # the reference runs into what it is writing: its period repeats
                period = bytes(out[back:])
                out += (period * (length // len(period) + 1))[:length]
    except IndexError:
        raise FormatError("the PCD file's compressed block is damaged") from None
    if len(out) != size:
        raise FormatError("the PCD file's compressed block is damaged")
    return bytes(out)

"""PCD, the Point Cloud Library's format: ascii, binary and binary_compressed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.text import parse_numbers

_KEYS = ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")


def _read_header(data: bytes) -> tuple[dict[str, list[str]], int]:
    head: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in head:
        end = data.find(b"\n", at)
        if end < 0 or at > 65536:
            raise FormatError("the PCD header has no DATA line; not a PCD file, or truncated")
        words = data[at:end].decode("latin-1").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0].upper() not in _KEYS:
            raise FormatError(f"not a PCD file: its header has a line '{words[0][:40]}'")
        head[words[0].upper()] = words[1:]
    return head, at


def read(path: Path, columns: str | None = None) -> PointFile:
    """The fields x, y, z and, if present, normal_x, normal_y, normal_z."""
    data = path.read_bytes()
    head, start = _read_header(data)
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
    if points < 0 or any(c < 1 for c in counts):
        raise FormatError("the PCD header gives a negative number")
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
    view = head.get("VIEWPOINT", [])
    notes = (
        ("the VIEWPOINT of the PCD file is not applied to its points",)
        if view and view != _NO_VIEW and any(map(_is_nonzero, view[:3]))
        else ()
    )
    return PointFile(stack("x", "y", "z"), stack(*wanted) if set(wanted) <= set(names) else None, notes=notes)


_NO_VIEW = ["0", "0", "0", "1", "0", "0", "0"]


def _is_nonzero(word: str) -> bool:
    return word.strip("-+0.eE") != ""


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

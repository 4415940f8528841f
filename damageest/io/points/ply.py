"""PLY, text or binary with either byte order: points, normals, colours and confidence of the vertices.

It is read in blocks, so that no more than the result and one block is in memory.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_colours, find_confidence, find_unit, scale_colours
from damageest.io.points.corners import list_ply_corners
from damageest.io.points.loose import drop_loose
from damageest.io.points.ply_header import Element, Header, read_header
from damageest.io.points.ply_lists import skip_rows
from damageest.io.points.text import parse_numbers

ROWS = 1 << 20
"""Vertices of a block."""
LINES = 100
"""Lines of text that tell how many numbers a vertex has."""
TEXT = 1 << 24
"""Bytes of text that are parsed at once."""

Columns = Mapping[str, Any] | NDArray[np.void]
"""Columns (N,) of a block by the names of the properties."""


def read(path: Path, columns: str | None = None) -> PointFile:
    """Points and, where the vertices have them, normals, colours and confidence. Vertices of a mesh that belong to no
    face are left out."""
    header = read_header(path)
    return drop_loose(read_vertices(path, header), list_ply_corners(path, header))


def read_vertices(path: Path, header: Header) -> PointFile:
    """All vertices, with what they have."""
    count, at = header.vertex.count, 0
    whole: dict[str, Any] = {}
    for block in read_blocks(path, header):
        piece = make_points(block, header)
        for name in ARRAYS:
            if (value := getattr(piece, name)) is not None:
                whole.setdefault(name, np.empty((count, *value.shape[1:]), value.dtype))[at : at + len(value)] = value
        at += len(piece.points)
    unit, said = find_unit(header.comments)
    return PointFile(**{"points": np.empty((0, 3)), **whole}, unit=unit, unit_said=said)


ARRAYS = ("points", "normals", "colours", "confidence")
"""What a block of vertices gives."""


def make_points(block: Columns, header: Header) -> PointFile:
    """Points, normals, colours and confidence of a block of vertices, without the unit."""
    kinds = dict(header.vertex.properties)

    def stack(which: Sequence[str], dtype: Any = np.float64) -> Any:
        out = np.empty((len(block[which[0]]), len(which)), dtype)
        for k, name in enumerate(which):
            out[:, k] = block[name]
        return out

    colours, confidence = find_colours(kinds), find_confidence(kinds)
    found = None
    if colours is not None:
        kind = np.dtype(kinds[colours[0]])
        whole = kind.kind in "iu"
        largest = float(np.iinfo(kind).max) if whole and kind.itemsize <= 2 else None
        found = scale_colours(stack(colours, kind if whole else np.float64), largest)
    return PointFile(
        stack("xyz"),
        stack(("nx", "ny", "nz")) if {"nx", "ny", "nz"} <= set(kinds) else None,
        colours=found,
        confidence=None if confidence is None else np.asarray(block[confidence], np.float32),
    )


def make_dtype(element: Element, order: str) -> np.dtype[np.void]:
    """The record of one item of an element without lists."""
    try:
        return np.dtype([(name, order + kind) for name, kind in element.properties])
    except ValueError:
        raise FormatError("two properties of the PLY file have the same name") from None


def read_blocks(path: Path, header: Header, rows: int = ROWS) -> Iterator[Columns]:
    """The vertices block by block, ``rows`` at most in a binary file. Raises FormatError where the file has fewer than
    its header says."""
    with path.open("rb") as stream:
        size = path.stat().st_size
        yield from (
            _read_text(stream, size, header) if header.form == "ascii" else _read_binary(stream, size, header, rows)
        )


def _read_binary(stream: BinaryIO, size: int, header: Header, rows: int) -> Iterator[Columns]:
    start, count = _find_vertices(stream, size, header), header.vertex.count
    kind = make_dtype(header.vertex, header.order)
    have = (size - start) // kind.itemsize
    if not 0 <= count <= have:
        raise FormatError(f"the PLY file is truncated: it has {max(have, 0)} of {count} vertices")
    stream.seek(start)
    for first in range(0, count, rows):
        yield np.fromfile(stream, kind, min(rows, count - first))


def _find_vertices(stream: BinaryIO, size: int, header: Header) -> int:
    """The position of the first vertex in a binary file."""
    start = header.end
    if not any(element.lists for element in header.before):
        return start + sum(one.count * make_dtype(one, header.order).itemsize for one in header.before)
    with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for element in header.before:
            start = skip_rows(data, start, element, header.order)
    return start


def _read_text(stream: BinaryIO, size: int, header: Header) -> Iterator[Columns]:
    names = [name for name, _ in header.vertex.properties]
    width, left = len(names), header.vertex.count
    stream.seek(header.end)
    for _ in range(sum(one.count for one in header.before)):
        if not stream.readline():
            raise FormatError("the PLY file is truncated")
    if left * width * 2 > size - stream.tell() + 1:
        raise FormatError(f"the PLY file is truncated: it is too small for the {left} vertices in its header")
    _require_width(stream, left, width)
    lines, rest, values = left, b"", np.empty(0)
    while left > 0:
        data = stream.read(TEXT)
        text, rest = _cut(rest + data, bool(data))
        if (ends := text.count(b"\n")) > lines:  # faces follow
            text = _take_lines(text, lines)
        lines -= ends
        values = np.concatenate([values, parse_numbers(text)]) if text.strip() else values
        rows = min(len(values) // width, left)
        if rows:
            table, values = values[: rows * width].reshape(rows, width), values[rows * width :]
            left -= rows
            yield {name: table[:, k] for k, name in enumerate(names)}
        if left and (not data or lines < 0):
            count = header.vertex.count
            raise FormatError(f"the PLY file is truncated: it has {count - left} of {count} vertices")


def _require_width(stream: BinaryIO, rows: int, width: int) -> None:
    """Raises FormatError where each of the first lines of the vertices has more numbers than the header says."""
    start = stream.tell()
    found = {len(stream.readline().split()) for _ in range(min(rows, LINES))}
    stream.seek(start)
    if len(found) == 1 and min(found) > width and min(found) % width:
        raise FormatError(
            f"the PLY header names {width} properties of a vertex, but the rows have {min(found)} numbers"
        )


def _cut(text: bytes, more: bool) -> tuple[bytes, bytes]:
    """The text up to the last end of a line, or of a word, and the rest; all of it where there is no more."""
    if not more:
        return text, b""
    at = max(text.rfind(b"\n"), -1)
    at = at if at >= 0 else max(text.rfind(b" "), text.rfind(b"\t"))
    return text[: at + 1], text[at + 1 :]


def _take_lines(data: bytes, count: int) -> bytes:
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == ord("\n"))
    return data[: int(ends[count - 1]) + 1] if count > 0 else b""

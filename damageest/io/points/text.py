"""Columns of numbers: XYZ, TXT, ASC, PTS, CSV, with the usual separators, comments and headers."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import CONFIDENCE, find_unit, scale_colours

_NAMES = {
    "x": "x", "y": "y", "z": "z", "nx": "nx", "ny": "ny", "nz": "nz",
    "normal_x": "nx", "normal_y": "ny", "normal_z": "nz", "normalx": "nx", "normaly": "ny", "normalz": "nz",
    "x_coordinate": "x", "y_coordinate": "y", "z_coordinate": "z",
    **dict.fromkeys(CONFIDENCE, "confidence"),
    "red": "red", "green": "green", "blue": "blue", "r": "red", "g": "green", "b": "blue",
}  # fmt: skip
_COLOUR = ("red", "green", "blue")
_NUMBER = re.compile(rb"^[+-]?(\d+\.?\d*([eEdD][+-]?\d+)?|\.\d+([eEdD][+-]?\d+)?|nan|inf(inity)?)$", re.IGNORECASE)


def parse_numbers(data: bytes) -> Floats:
    """All numbers of a text with white space as separator. Raises FormatError if a word is not a number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(data.decode("latin-1"), dtype=np.float64, sep=" ")  # the fastest parser of numpy
        except (DeprecationWarning, ValueError):
            pass
    words = data.split()
    for word in words:
        if not _NUMBER.match(word):
            raise FormatError(f"'{word[:40].decode('latin-1')}' is not a number")
    return np.array(words, dtype="S").astype(np.float64)


def read(path: Path, columns: str | None = None) -> PointFile:
    """Points from the columns x, y, z, and those of normals, colours and confidence, identified by ``columns``, the
    header, or, but for colours and confidence, their number."""
    data = path.read_bytes()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        data = data.decode("utf-16", errors="replace").encode("latin-1", errors="replace")
    data = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\0" in data[:4096]:
        raise FormatError("not a text file: it has binary data")
    unit, said = find_unit(_list_head(data[:4096].decode("latin-1")))
    if b"#" in data or b"//" in data:
        head = re.search(rb"^\s*(?:#|//)+(.*)$", data[:4096], re.MULTILINE)
        names = _find_names(head.group(1)) if head and columns is None else None
        data = re.sub(rb"(#|//)[^\n]*", b"", data)
    else:
        names = None
    data, header = _strip_header(data.strip())
    names = header or names
    data = _unify_separators(data)
    first = data.split(b"\n", 1)[0].split()
    if not first:
        raise FormatError("has no points")
    width = len(first)
    values = parse_numbers(data)
    lines = _count_lines(data)
    if len(values) != width * lines:
        raise FormatError(_describe_ragged(data, width))
    table = values.reshape(-1, width)
    given = [_NAMES.get(word.lower(), word) for word in columns.replace(",", " ").split()] if columns else names
    return replace(_select_columns(table, given), unit=unit, unit_said=said)


def _list_head(text: str) -> list[str]:
    """The comments and the line of names in front of the first row, with the unit of a column in words."""
    lines: list[str] = []
    for line in text.split("\n"):
        words = re.split(r"[\s,;]+", line.strip())
        if words[0] and all(_NUMBER.match(word.encode("latin-1", "replace")) for word in words if word):
            if len(words) > 1:  # not the number of points
                break
            continue
        column = re.search(r"\bx\b\s*[\[(]\s*([a-zµ]+)\s*[\])]", line, re.IGNORECASE)
        lines.append(f"x in units: {column.group(1)}" if column else line)
    return lines


def _find_names(line: bytes) -> list[str] | None:
    """The names of the columns, or None if x, y and z are not among them."""
    bare = re.sub(r"\s*[\[(][^\])]*[\])]|\"", "", line.decode("latin-1").lower())  # without units, as in 'x [mm]'
    found = [_NAMES.get(word, "_") for word in re.split(r"[\s,;]+", bare.strip())]
    return found if {"x", "y", "z"} <= set(found) else None


def _strip_header(data: bytes) -> tuple[bytes, list[str] | None]:
    """The text without the lines before the first row, and the names of the columns if one of these lines has them."""
    names = None
    for _ in range(3):
        line, _, rest = data.partition(b"\n")
        words = [w for w in re.split(rb"[\s,;]+", line.strip()) if w]
        if len(words) == 1 and words[0].isdigit() and rest.strip():
            data = rest.strip()
        elif words and not all(_NUMBER.match(w) for w in words):
            names = names or _find_names(line)
            if names is None and any(_NUMBER.match(w) for w in words):
                word = next(w for w in words if not _NUMBER.match(w))
                raise FormatError(f"line '{line[:60].decode('latin-1')}': '{word.decode('latin-1')}' is not a number")
            data = rest.strip()
        else:
            break
    return data, names


def _unify_separators(data: bytes) -> bytes:
    """The text with white space for every separator. If ';' is the separator, ',' is the decimal point."""
    if b";" in data:
        return data.replace(b",", b".").replace(b";", b" ")
    return data.replace(b",", b" ")


def _count_lines(data: bytes) -> int:
    lines = data.count(b"\n") + 1
    if b"\n\n" in data or re.search(rb"\n[ \t]+\n", data):
        lines = sum(1 for line in data.split(b"\n") if line.strip())
    return lines


def _describe_ragged(data: bytes, width: int) -> str:
    for number, line in enumerate((row for row in data.split(b"\n") if row.strip()), 1):
        if (here := len(line.split())) != width:
            return f"row {number} has {here} columns, but the first row has {width}; the file may be truncated"
    return "rows have different numbers of columns"


def _select_columns(table: Floats, names: list[str] | None) -> PointFile:
    width = table.shape[1]
    if names is not None:
        if not {"x", "y", "z"} <= set(names):
            raise FormatError(f"the columns must include x, y and z; they are: {' '.join(names)}")
        if len(names) > width:
            raise FormatError(f"{len(names)} columns are named, but the rows have {width} columns")
        normals = [names.index(n) for n in ("nx", "ny", "nz")] if {"nx", "ny", "nz"} <= set(names) else None
        colours = [names.index(n) for n in _COLOUR] if set(_COLOUR) <= set(names) else None
        return PointFile(
            table[:, [names.index(n) for n in "xyz"]],
            None if normals is None else table[:, normals],
            colours=None if colours is None else scale_colours(table[:, colours]),
            confidence=table[:, names.index("confidence")].astype(np.float32) if "confidence" in names else None,
        )
    if width < 3:
        raise FormatError(f"the rows have {width} columns; a point needs three: x y z")
    for start in (3, width - 3):  # normals, not colours: the length is 1
        if start >= 3 and width >= 6:
            tail = table[:, start : start + 3]
            if np.abs(np.linalg.norm(tail[:: max(1, len(tail) // 1000)], axis=1) - 1).max() < 0.02:
                return PointFile(table[:, :3], tail)
    return PointFile(table[:, :3])

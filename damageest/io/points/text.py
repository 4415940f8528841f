"""Columns of numbers: XYZ, TXT, ASC, PTS, CSV, with the usual separators, comments and headers."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_unit
from damageest.io.points.text_columns import guess_columns, list_other_ways, name_columns, select_columns

_NUMBER = re.compile(
    rb"^[+-]?(\d+\.?\d*([ed][+-]?\d+)?|\.\d+([ed][+-]?\d+)?|nan(\(\w*\))?|inf(inity)?|1\.#(ind|inf|[qs]nan)\d*)$",
    re.IGNORECASE,
)
_NO_NUMBER = re.compile(rb"[+-]?(nan\(\w*\)|1\.#(ind|[qs]nan)\d*)", re.IGNORECASE)
"""As C of Windows writes what is no number."""
_EXPONENT = re.compile(rb"(?<=[\d.])[dD](?=[+-]?\d)")
"""As Fortran writes it."""
_TYPED = ((b"\xe2\x88\x92", b"-"), (b"\xc2\xa0", b" "), (b"\xe2\x80\xaf", b" "))
"""The minus of typesetting, and spaces that do not break, in UTF-8."""
_DECIMAL_COMMA = re.compile(rb"^[+-]?\d+(,\d+)?([ed][+-]?\d+)?$", re.IGNORECASE)
_FRACTION = re.compile(rb",(?:0\d|\d+[eEdD][+-]?\d)")
"""Digits behind a decimal comma: no whole number begins with 0, or has an exponent."""
_QUOTED = re.compile(rb'"[ \t]*([+-]?[\d.,]+(?:[eEdD][+-]?\d+)?|nan)[ \t]*"', re.IGNORECASE)
_COUNT = re.compile(rb"^[ \t]*\d+[ \t]*\n", re.MULTILINE)
"""A line with the number of points of a scan that follows."""
MOST_HEAD = 200
"""Lines in front of the first row, at most."""


def parse_numbers(data: bytes) -> Floats:
    """All numbers of a text with white space as separator. Raises FormatError if a word is not a number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(data.decode("latin-1"), dtype=np.float64, sep=" ")  # the fastest parser of numpy
        except (DeprecationWarning, ValueError):
            pass
    data = _EXPONENT.sub(b"e", _NO_NUMBER.sub(b"nan", data))
    words = data.split()
    for word in words:
        if not _NUMBER.match(word):
            raise FormatError(f"'{word[:40].decode('latin-1')}' is not a number")
    return np.array(words, dtype="S").astype(np.float64)


def read(path: Path, columns: str | None = None) -> PointFile:
    """Points from the columns x, y, z, and those of normals, colours and confidence, identified by ``columns``, the
    header, or, but for colours and confidence, their values."""
    table, names, unit, said = read_table(path)
    return replace(select_columns(table, columns, names), unit=unit, unit_said=said)


def list_other_columns(path: Path) -> list[str]:
    """The ways, as ``columns`` of `read` says them, in which a table without names may be meant besides."""
    table, names, _, _ = read_table(path)
    if names is not None or table.shape[1] < 4:
        return []
    taken = guess_columns(table)[0]
    return [" ".join(way) for way in list_other_ways(table, taken)]


def read_table(path: Path) -> tuple[Floats, list[str] | None, str | None, str]:
    """The numbers (N,C), the names of the columns where a line names x, y and z, and the unit as `find_unit` has it."""
    data = path.read_bytes()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        data = data.decode("utf-16", errors="replace").encode("utf-8", errors="replace")
    data = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    for other, plain in _TYPED:
        data = data.replace(other, plain)
    if b"\0" in data[:4096]:
        raise FormatError("not a text file: it has binary data")
    unit, said = find_unit(_list_head(data[:4096].decode("utf-8", "replace")))
    if b"1.#" in data:  # no comment begins there
        data = _NO_NUMBER.sub(b"nan", data)
    comments: list[list[str]] = []
    if b"#" in data or b"//" in data:
        head = re.findall(rb"^\s*(?:#|//)+(.*)$", data[:4096], re.MULTILINE)
        comments = [found for line in head if (found := name_columns(line.decode("utf-8", "replace").strip()))]
        data = re.sub(rb"(#|//)[^\n]*", b"", data)
    if b'"' in data:  # a comma inside is the decimal point
        data = _QUOTED.sub(lambda found: found.group(1).replace(b",", b"."), data.replace(b'""', b""))
    data, names = _strip_header(data.strip(b"\n "))
    table = _parse_rows(_unify_separators(data))
    fitting = [found for found in comments if len(found) == table.shape[1]]  # else a sentence with an x in it
    return table, names or next(iter(fitting), None), unit, said


def _parse_rows(data: bytes) -> Floats:
    first = data.split(b"\n", 1)[0].split()
    if not first:
        raise FormatError("has no points")
    width = len(first)
    values, lines = parse_numbers(data), _count_lines(data)
    if len(values) != width * lines and width > 1:  # the counts between the scans of a PTS file
        data = _COUNT.sub(b"", data)
        values, lines = parse_numbers(data), _count_lines(data)
    if len(values) != width * lines:
        raise FormatError(_describe_ragged(data, width))
    return values.reshape(-1, width)


def _list_head(text: str) -> list[str]:
    """The comments and the line of names in front of the first row, with the unit of a column in words."""
    lines: list[str] = []
    for line in text.split("\n"):
        words = re.split(r"[\s,;]+", line.strip())
        if words[0] and all(_NUMBER.match(word.encode("latin-1", "replace")) for word in words if word):
            if len(words) > 1:  # not the number of points
                break
            continue
        column = re.search(r"\bx\b\s*[\[(]\s*([a-zµμ]+)\s*[\])]", line, re.IGNORECASE)
        lines.append(f"x in units: {column.group(1)}" if column else line)
    return lines


def _strip_header(data: bytes) -> tuple[bytes, list[str] | None]:
    """The text without the lines before the first row, and the names of the columns if one of these lines has them."""
    names, mixed, rest = None, list[tuple[bytes, list[bytes]]](), data
    for _ in range(MOST_HEAD):
        line, _, after = rest.partition(b"\n")
        words = [w for w in re.split(rb"[\s,;]+", line.strip()) if w]
        is_count = len(words) == 1 and words[0].isdigit() and bool(after.strip())
        if words and not is_count and all(_NUMBER.match(w) for w in words):
            for wrong, row in mixed:  # a row with a word in it is no header
                if len(row) == len(words) and 2 * sum(bool(_NUMBER.match(w)) for w in row) >= len(row):
                    _refuse_word(wrong, row)
            return rest, names
        if not after.strip():
            break
        if words and not is_count:
            found = name_columns(line.decode("utf-8", "replace"))
            names = names or found
            if found is None and any(_NUMBER.match(w) for w in words):
                mixed.append((line, words))
        rest = after.strip()
    if mixed:
        _refuse_word(*mixed[0])
    return rest, names


def _refuse_word(line: bytes, words: list[bytes]) -> None:
    word = next(w for w in words if not _NUMBER.match(w)).decode("latin-1")
    raise FormatError(f"line '{line[:60].decode('latin-1')}': '{word}' is not a number")


def _unify_separators(data: bytes) -> bytes:
    """The text with white space for every separator. If ';' or white space is the separator, ',' is the decimal point:
    each word of the first row then has one comma at most. What stands between two separators in a row is no number."""
    first = data.split(b"\n", 1)[0]
    by_space = len(first.split()) >= 3 and b"." not in data[:4096] and all(map(_DECIMAL_COMMA.match, first.split()))
    if b";" in data:
        return _fill_empty(data, b";").replace(b",", b".").replace(b";", b" ")
    if by_space:
        return data.replace(b",", b".")
    if b"." not in data[:4096] and first.count(b",") >= 5 and _FRACTION.search(data[:4096]):
        raise FormatError(
            f"row '{first[:60].decode('latin-1')}': the comma separates columns, and seems to be the decimal point "
            "too; export with a decimal point, or with semicolons between the columns"
        )
    return _fill_empty(data, b",").replace(b",", b" ")


def _fill_empty(data: bytes, mark: bytes) -> bytes:
    """The text with 'nan' between separators that have nothing between them, and in front of one that begins a row."""
    if mark * 2 not in data and b"\n" + mark not in data and not data.startswith(mark) and mark + b" " not in data:
        return data
    return re.sub(rb"(^|(?<=" + mark + rb"))[ \t]*(?=" + mark + rb")", b"nan", data, flags=re.MULTILINE)


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

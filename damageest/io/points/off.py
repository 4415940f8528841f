"""The rows of a text OFF file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError
from damageest.io.points.text import parse_numbers


def read_off_rows(path: Path) -> tuple[Floats, list[bytes], int, str]:
    """The numbers (V,3 or more) of the vertices of a text OFF file, the lines after them, of which the first are the
    faces, how many these should be, and what the header says in front of OFF. Raises FormatError."""
    data = path.read_bytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    data = re.sub(rb"#[^\n]*", b"", data).strip()
    start = re.match(rb"(?:((?:ST)?C?N?)OFF\s+)?(\d+)\s+(\d+)(\s+\d+)?[ \t]*\n", data)
    if not start:
        first = data[:60].split(b"\n", 1)[0].decode("latin-1").strip()
        raise FormatError(f"not a text OFF file of three coordinates: it begins with '{first}'")
    count = int(start.group(2))
    lines = [line for line in data[start.end() :].split(b"\n") if line.strip()]
    if len(lines) < count:
        raise FormatError(f"the OFF file is truncated: it has {len(lines)} of {count} vertices")
    mark = (start.group(1) or b"").decode()
    if not count:
        return np.empty((0, 3)), lines, int(start.group(3)), mark
    values = parse_numbers(b"\n".join(lines[:count]))
    if len(values) % count or len(values) < 3 * count:
        raise FormatError("not all vertices have three coordinates")
    return values.reshape(count, -1), lines[count:], int(start.group(3)), mark

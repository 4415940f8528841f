"""What the columns of a table of numbers are: by their names, or, where nothing names them, by their values."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import CONFIDENCE, scale_colours

_NAMES = {
    **dict.fromkeys(CONFIDENCE, "confidence"),
    "red": "red", "green": "green", "blue": "blue", "r": "red", "g": "green", "b": "blue",
    **{f"diffuse_{name}": name for name in ("red", "green", "blue")},
}  # fmt: skip
_AXIS = re.compile(
    r"^(?:(?:points?|coord(?:inate)?s?|pos(?:ition)?s?|vert(?:ex|ices)|location|axis|p)[ :_.\-]*)?([xyz012])"
    r"(?:[ :_.\-]*(?:coord(?:inate)?s?|pos(?:ition)?|values?|axis|mm|cm|m|in|inch|um))?$"
)
_NORMAL = re.compile(r"^(?:n|(?:normals?|norm|vertex normals?)[ :_.\-]*)([xyz012])$")
_COLOUR = ("red", "green", "blue")
LENGTH_OFF = 0.02
"""How far the length of a normal that is written with few digits may be off 1."""
SHOWN = 1000
"""Rows, at most, that show what columns are."""


def name_column(word: str) -> str:
    """What the name of a column means: x, y, z, nx, ny, nz, red, green, blue, confidence; '_' for all else."""
    bare = re.sub(r"\s*[\[({][^\])}]*[\])}]|[\"']", "", word).strip().lower()  # without a unit, as in 'x [mm]'
    for pattern, mark in ((_AXIS, ""), (_NORMAL, "n")):
        if (found := pattern.match(bare)) and not (found.group(1).isdigit() and found.group(1) == bare):
            axis = found.group(1)
            return mark + ("xyz"[int(axis)] if axis.isdigit() else axis)
    return _NAMES.get(bare, "_")


def name_columns(line: str) -> list[str] | None:
    """What the names of the columns in a line mean; None where x, y and z are not among them."""
    for mark in (";", "\t", ","):
        if line.count(mark) >= 2:
            words = line.rstrip(f"{mark} \r").split(mark)
            break
    else:
        words = re.sub(r"\s*[\[({][^\])}]*[\])}]|\"", "", line).split()
    found = [name_column(word) for word in words]
    return found if {"x", "y", "z"} <= set(found) else None


def select_columns(table: Floats, given: str | None, named: list[str] | None) -> PointFile:
    """The points of a table (N,C), and what was taken for x, y and z.

    ``given``: what the job says of the columns; ``named``: their names in the file. Raises FormatError where neither
    fits the table, or it is too narrow.
    """
    width = table.shape[1]
    if given:
        words = given.replace(",", " ").split()
        names = [name if (name := name_column(word)) != "_" else word for word in words]
        if not {"x", "y", "z"} <= set(names):
            raise FormatError(f"the columns must include x, y and z; they are: {' '.join(names)}")
        if len(names) > width:
            raise FormatError(f"{len(names)} columns are named, but the rows have {width} columns")
        return _take(table, names, "as scan.columns says")
    if width < 3:
        raise FormatError(f"the rows have {width} columns; a point needs three: x y z")
    if named is not None:
        return _take(table, _fit_names(table, named), "by their names in the file")
    names, why = guess_columns(table)
    return _take(table, names, why)


def _fit_names(table: Floats, names: list[str]) -> list[str]:
    """The names with one for each column. Raises FormatError where the rows have another number of columns."""
    width = table.shape[1]
    if len(names) == width:
        return names
    if len(names) == width - 1 and _counts_rows(table[:, 0]):  # as R writes a table: row names have no name
        return ["_", *names]
    raise FormatError(
        f"{len(names)} columns are named, but the rows have {width} columns; name them in  scan.columns,  "
        "for example 'x y z _ nx ny nz'"
    )


def list_other_ways(table: Floats, taken: list[str]) -> list[list[str]]:
    """What else columns without names may be: x, y, z in any three that stand beside each other, and are neither
    normals nor the number of the row, in place of those ``taken``."""
    width, ways = table.shape[1], list[list[str]]()
    for first in range(width - 2):
        names = ["_"] * first + ["x", "y", "z"] + ["_"] * (width - 3 - first)
        own = table[:, first : first + 3]
        flat = (np.nanmax(own, axis=0, initial=-np.inf) == np.nanmin(own, axis=0, initial=np.inf)).sum() > 1
        if taken[first] != "x" and not flat and not _are_normals(own) and not _counts_rows(table[:, first]):
            ways.append(names)
    return ways


def guess_columns(table: Floats) -> tuple[list[str], str]:
    """What columns without names are, and why."""
    width = table.shape[1]
    if width >= 4 and _counts_rows(table[:, 0]):
        names, _ = guess_columns(table[:, 1:])
        return ["_", *names], "since the first column counts the points"
    names = ["x", "y", "z"] + ["_"] * (width - 3)
    if width >= 6:
        for first in (3, width - 3):  # normals, not colours: the length is 1
            if _are_normals(table[:, first : first + 3]):
                return [*names[:first], "nx", "ny", "nz", *names[first + 3 :]], _unnamed(width)
        if _are_normals(table[:, :3]) and not _are_colours(table[:, 3:6]):
            why = "since the first three columns have the length 1, as normals have"
            return ["nx", "ny", "nz", "x", "y", "z"] + ["_"] * (width - 6), why
    return names, _unnamed(width)


def _unnamed(width: int) -> str:
    return "since nothing names the columns" if width > 3 else ""


def _counts_rows(column: Floats) -> bool:
    """Whether a column has the number of its row, from any number on."""
    return len(column) > 2 and float(column[0]).is_integer() and bool((np.diff(column) == 1).all())


def _are_normals(columns: Floats) -> bool:
    length = np.linalg.norm(columns[:: max(1, len(columns) // SHOWN)], axis=1)
    known = length[np.isfinite(length)]
    return len(known) > 0.5 * len(length) and bool(np.abs(known - 1).max() < LENGTH_OFF)


def _are_colours(columns: Floats) -> bool:
    some = columns[:: max(1, len(columns) // SHOWN)]
    return bool(((some >= 0) & (some <= 255) & (some == np.round(some))).all())


def _take(table: Floats, names: list[str], why: str) -> PointFile:
    normals = [names.index(n) for n in ("nx", "ny", "nz")] if {"nx", "ny", "nz"} <= set(names) else None
    colours = [names.index(n) for n in _COLOUR] if set(_COLOUR) <= set(names) else None
    places = [names.index(n) for n in "xyz"]
    cloud = PointFile(
        table[:, places],
        None if normals is None else table[:, normals],
        colours=None if colours is None else scale_colours(table[:, colours]),
        confidence=table[:, names.index("confidence")].astype(np.float32) if "confidence" in names else None,
    )
    if not why:
        return cloud
    x, y, z = (place + 1 for place in places)
    also = ", normals {}, {}, {}".format(*(place + 1 for place in normals)) if normals else ""
    return replace(cloud, columns=f"x, y, z are columns {x}, {y}, {z} of {table.shape[1]}{also}, {why}")

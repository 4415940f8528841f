"""Elements of a PLY file whose rows have lists, and so differ in length."""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Ints
from damageest.io.points import FormatError
from damageest.io.points.ply_header import Element, Header
from damageest.io.points.text import parse_numbers

LONGEST_RUN = 1 << 16
"""Rows that are compared at once with the first of them."""


def read_lists(path: Path, header: Header, element: Element, name: str) -> tuple[Ints, Ints]:
    """The items (C,) of one list of all rows of an element, one row after the other, and their number (F,) in each.

    Raises FormatError where the file ends before.
    """
    items, counts = list[NDArray[Any]](), list[NDArray[Any]]()
    for rows in _walk_file(path, header, element):
        items.append(rows[f"{name} items"].ravel())
        counts.append(rows[f"{name} count"])
    empty = np.empty(0)
    return np.concatenate([empty, *items]).astype(np.int64), np.concatenate([empty, *counts]).astype(np.int64)


def walk_lists(path: Path, header: Header, element: Element, name: str) -> Iterator[Ints]:
    """The items (C,) of one list of an element, in pieces. Raises FormatError where the file ends before."""
    for rows in _walk_file(path, header, element):
        yield rows[f"{name} items"].ravel().astype(np.int64)


def _walk_file(path: Path, header: Header, element: Element) -> list[NDArray[np.void]]:
    """The rows of an element in runs of equal length."""
    with path.open("rb") as stream:
        data: Any = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    at, order = header.end, header.order
    text = header.form == "ascii"
    if text:
        data, at, order = parse_numbers(data[header.end :]).tobytes(), 0, "="
    for one in header.elements:
        if one is element:
            break
        at = skip_rows(data, at, one, order, text)
    return _walk(data, at, element, order, text)[0]


def skip_rows(data: Any, at: int, element: Element, order: str, text: bool = False) -> int:
    """The position behind the rows of an element that begin ``at``. Raises FormatError where the file ends before.

    ``text``: the bytes are numbers of eight bytes each, whatever the header says.
    """
    if not element.lists:
        return at + element.count * _describe(data, at, element, order, text).itemsize
    return _walk(data, at, element, order, text)[1]


def _walk(data: Any, at: int, element: Element, order: str, text: bool) -> tuple[list[NDArray[np.void]], int]:
    """The rows in runs of equal length, and the position behind them."""
    runs, left, most = list[NDArray[np.void]](), element.count, LONGEST_RUN
    while left > 0:
        kind = _describe(data, at, element, order, text)
        have = (len(data) - at) // kind.itemsize
        rows = np.frombuffer(data, kind, min(have, left, most), at)
        if not len(rows):
            raise _truncated(element)
        other = np.zeros(len(rows), bool)
        for one in element.lists:
            other |= rows[f"{one.name} count"] != rows[f"{one.name} count"][0]
        alike = int(other.argmax()) if other.any() else len(rows)
        most = min(max(4 * alike, 16), LONGEST_RUN)
        runs.append(rows[:alike])
        left -= alike
        at += alike * kind.itemsize
    return runs, at


def _describe(data: Any, at: int, element: Element, order: str, text: bool) -> np.dtype[np.void]:
    """The record of the row ``at`` a position, whose lists have the lengths that it says."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    size = 0
    for place in range(len(element.properties) + 1):
        for one in element.lists:
            if one.place != place:
                continue
            counter, item = ("=f8", "=f8") if text else (order + one.counter, order + one.item)
            width = np.dtype(counter).itemsize
            if at + size + width > len(data):
                raise _truncated(element)
            count = int(np.frombuffer(data, counter, 1, at + size)[0])
            if not 0 <= count <= len(data):
                raise FormatError(f"a list of the PLY element '{element.name}' has {count} items")
            fields += [(f"{one.name} count", counter), (f"{one.name} items", item, (count,))]
            size += width + count * np.dtype(item).itemsize
        if place < len(element.properties):
            name, kind = element.properties[place]
            kind = "=f8" if text else order + kind
            fields.append((name, kind))
            size += np.dtype(kind).itemsize
    try:
        return np.dtype(fields)
    except ValueError:
        raise FormatError("two properties of the PLY file have the same name") from None


def _truncated(element: Element) -> FormatError:
    return FormatError(f"the PLY file is truncated in its element '{element.name}'")

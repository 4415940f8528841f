"""Numbers the entities of a STEP file by what they say, so that equal content gives equal bytes.

OpenCASCADE writes the colours of an assembly in the order of a table of addresses, which differs from run to run. It
also writes each edge in the parameters of both its faces. Between two planes an edge is a line, and these curves, which
make a file of facets four times as large, are left out.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

_ENTITY = re.compile(r"#(\d+)\s*=\s*((?:'(?:[^']|'')*'|[^';])*);")
_TOKEN = re.compile(r"('(?:[^']|'')*'|#\d+)")
_STRING = re.compile(r"('(?:[^']|'')*')")
_BREAK = re.compile(r"\s*\n\s*")
_UNORDERED = "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION"
DEPTH = 8
"""Steps from a root within which roots differ: the name of a product is five steps away."""

Tokens = dict[int, list[str]]
"""Each entity, by its number, as text in which every second item is a string or a reference."""


def canonicalise(path: Path) -> None:
    """Writes the file again: entities in the order in which its roots lead to them, roots in that of their content, and
    last the lists of colours, whose items are in the order of their content."""
    text = path.read_text(encoding="latin-1")
    start = text.index("DATA;") + len("DATA;")
    end = text.index("ENDSEC;", start)
    tokens = {int(found[1]): _TOKEN.split(_join_lines(found[2])) for found in _ENTITY.finditer(text, start, end)}
    uses = {number: [int(item[1:]) for item in each[1::2] if item[0] == "#"] for number, each in tokens.items()}
    used = {item for items in uses.values() for item in items}
    roots = [number for number in tokens if number not in used]
    _leave_out_plane_curves(tokens, uses)
    colours = [number for number in roots if tokens[number][0].startswith(_UNORDERED)]
    order: dict[int, int] = {}
    _number(sorted(set(roots) - set(colours), key=lambda root: _digest(root, tokens, order, DEPTH)), uses, order)
    for number in colours:
        _sort_first_list(number, tokens, uses, order)
    _number(sorted(colours, key=lambda root: _digest(root, tokens, order, DEPTH)), uses, order)
    lines = [f"#{new} = {_write(tokens[old], order)};" for old, new in order.items()]
    path.write_text(text[:start] + "\n" + "\n".join(lines) + "\n" + text[end:], encoding="latin-1")


def _leave_out_plane_curves(tokens: Tokens, uses: dict[int, list[int]]) -> None:
    """Makes edges between two planes their curve in space; nothing leads to their curves in the planes any more."""
    for number, entity in tokens.items():
        if entity[0].startswith("SURFACE_CURVE"):
            line, *curves = uses[number]
            if all(tokens[uses[curve][0]][0].startswith("PLANE") for curve in curves):
                tokens[number], uses[number] = tokens[line], uses[line]


def _join_lines(entity: str) -> str:
    if "\n" not in entity:
        return entity
    # in a string, OpenCASCADE breaks the line between any two characters, and spaces beside the break belong to it
    parts = _STRING.split(entity)
    return "".join([part.replace("\n", "") if part[:1] == "'" else _BREAK.sub("", part) for part in parts])


def _number(roots: Iterable[int], uses: Mapping[int, list[int]], order: dict[int, int]) -> None:
    """Numbers all that roots lead to and that has no number in ``order`` yet."""
    for root in roots:
        stack = [root]
        while stack:
            number = stack.pop()
            if number not in order:
                order[number] = len(order) + 1
                stack += uses[number][::-1]


def _write(entity: list[str], order: Mapping[int, int]) -> str:
    return "".join([f"#{order[int(item[1:])]}" if item[:1] == "#" else item for item in entity])


def _digest(number: int, tokens: Tokens, order: Mapping[int, int], depth: int) -> str:
    """A digest of what an entity says, with what it refers to within ``depth`` steps. What
    is in ``order`` counts by its number there."""
    said = []
    for item in tokens[number]:
        if item[:1] != "#":
            said.append(item)
        elif int(item[1:]) in order:
            said.append(f"#{order[int(item[1:])]}")
        elif depth:
            said.append(_digest(int(item[1:]), tokens, order, depth - 1))
    return hashlib.sha256("".join(said).encode()).hexdigest()


def _sort_first_list(number: int, tokens: Tokens, uses: dict[int, list[int]], order: Mapping[int, int]) -> None:
    """Puts the items of an entity's list, the references before the last one, in the order of their content."""
    *items, last = uses[number]
    uses[number] = [*sorted(items, key=lambda item: _digest(item, tokens, order, DEPTH)), last]
    names = iter(uses[number])
    tokens[number] = [f"#{next(names)}" if item[:1] == "#" else item for item in tokens[number]]

"""Numbers the entities of a STEP file by what they say, so that equal content gives equal bytes.

OpenCASCADE writes the colours of an assembly in the order of a table of addresses, which differs from run to run.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

_ENTITY = re.compile(r"#(\d+)\s*=\s*((?:'(?:[^']|'')*'|[^';])*);")
_STRING_OR_REFERENCE = re.compile(r"'(?:[^']|'')*'|#(\d+)")
_UNORDERED = "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION"


def canonicalise(path: Path) -> None:
    """Writes the file again: entities in the order in which its roots lead to them, roots in that of their content."""
    text = path.read_text(encoding="latin-1")
    start = text.index("DATA;") + len("DATA;")
    end = text.index("ENDSEC;", start)
    entities = {int(found[1]): _join_lines(found[2]) for found in _ENTITY.finditer(text, start, end)}
    uses = {number: _find_references(entity) for number, entity in entities.items()}
    digests = _digest(entities, uses)
    for number, entity in entities.items():
        if entity.startswith(_UNORDERED):
            uses[number] = sorted(uses[number], key=lambda item: digests[item])
            entities[number] = _sort_list(entity, digests)
    used = {item for items in uses.values() for item in items}
    roots = sorted((number for number in entities if number not in used), key=lambda number: digests[number])
    order: dict[int, int] = {}
    stack = roots[::-1]
    while stack:
        number = stack.pop()
        if number not in order:
            order[number] = len(order) + 1
            stack += uses[number][::-1]
    lines = [f"#{new} = {_renumber(entities[old], order)};" for old, new in order.items()]
    path.write_text(text[:start] + "\n" + "\n".join(lines) + "\n" + text[end:], encoding="latin-1")


def _join_lines(entity: str) -> str:
    return re.sub(r"\s*\n\s*", "", entity).strip()


def _find_references(entity: str) -> list[int]:
    return [int(found[1]) for found in _STRING_OR_REFERENCE.finditer(entity) if found[1]]


def _renumber(entity: str, order: dict[int, int]) -> str:
    return _STRING_OR_REFERENCE.sub(lambda found: f"#{order[int(found[1])]}" if found[1] else found[0], entity)


def _digest(entities: dict[int, str], uses: dict[int, list[int]]) -> dict[int, str]:
    """A digest of what each entity says, with all that it refers to. References form no circle."""
    done: dict[int, str] = {}
    for first in entities:
        stack = [first]
        while stack:
            number = stack[-1]
            missing = [item for item in uses[number] if item not in done]
            if number in done or not missing:
                stack.pop()
                if number not in done:
                    done[number] = _digest_one(entities[number], done)
            else:
                stack += missing
    return done


def _digest_one(entity: str, done: dict[int, str]) -> str:
    if entity.startswith(_UNORDERED):
        content = re.sub(r"#\d+", "#", entity) + "".join(sorted(done[item] for item in _find_references(entity)))
    else:
        content = _STRING_OR_REFERENCE.sub(lambda found: done[int(found[1])] if found[1] else found[0], entity)
    return hashlib.sha256(content.encode()).hexdigest()


def _sort_list(entity: str, digests: dict[int, str]) -> str:
    """The entity with the items of its first list in the order of their content."""
    found = re.search(r"\((#[\d,#\s]+)\)", entity)
    if found is None:
        return entity
    items = sorted(_find_references(found[1]), key=lambda item: digests[item])
    return entity[: found.start()] + "(" + ",".join(f"#{item}" for item in items) + ")" + entity[found.end() :]

"""Entities of a STEP file (ISO 10303-21), as far as its product and manufacturing information needs them.

OpenCASCADE's own reader of tolerances gives 0 for amounts that are complex entities, and no faces for datums by a set
of items (tried on files of NIST). So the entities are read from the text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

Value = object
"""A reference, a number, a text, an enumeration as text with dots, a list of values, a `Typed` value, or None."""

_STATEMENT = re.compile(r"(?:'[^']*+(?:'|\Z)|/\*(?:[^*]|\*(?!/))*+(?:\*/|\Z)|[^';/]|/(?!\*))*+(?:;|\Z)", re.S)
"""Takes what is no statement too, so that no place is looked at twice."""
_TOKEN = re.compile(
    r"\s+|/\*(?:[^*]|\*(?!/))*+(?:\*/|\Z)|'(?:[^']|'')*'|#\d+|[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?|\.[A-Za-z0-9_]+\.|\"[0-9A-Fa-f]*\"|[A-Za-z_]\w*|[(),$*=]",
    re.S,
)


@dataclass(frozen=True)
class Ref:
    number: int


@dataclass(frozen=True)
class Typed:
    """A value with the name of its type, as LENGTH_MEASURE(0.2)."""

    name: str
    values: tuple[Value, ...]


Entity = dict[str, tuple[Value, ...]]
"""Types with their values; more than one where the entity is complex."""


def read_entities(text: str) -> dict[int, Entity]:
    """The entities by number. Statements that are no entities are skipped."""
    found: dict[int, Entity] = {}
    for match in _STATEMENT.finditer(text):
        head = re.match(r"\s*#(\d+)\s*=", match.group())
        if head is None or not match.group().endswith(";"):
            continue
        tokens = _split(match.group()[head.end() : -1])
        try:
            found[int(head.group(1))] = _read_entity(tokens)
        except (StopIteration, ValueError):
            continue
    return found


def _split(text: str) -> Iterator[str]:
    return iter([one for one in _TOKEN.findall(text) if one.strip() and not one.startswith("/*")])


def _read_entity(tokens: Iterator[str]) -> Entity:
    name = next(tokens)
    if name != "(":
        return {name.upper(): _read_list(tokens, next(tokens))}
    parts: Entity = {}
    while (name := next(tokens)) != ")":
        parts[name.upper()] = _read_list(tokens, next(tokens))
    return parts


def _read_list(tokens: Iterator[str], first: str) -> tuple[Value, ...]:
    if first != "(":
        raise ValueError("a list of values begins with a bracket")
    values: list[Value] = []
    while (token := next(tokens)) != ")":
        if token != ",":
            values.append(_read_value(token, tokens))
    return tuple(values)


def _read_value(token: str, tokens: Iterator[str]) -> Value:
    if token == "(":
        return _read_list(tokens, token)
    if token[0] == "#":
        return Ref(int(token[1:]))
    if token[0] == "'":
        return token[1:-1].replace("''", "'")
    if token in "$*":
        return None
    if token[0] in "+-0123456789":
        return float(token)
    if token[0] in '."':
        return token
    return Typed(token.upper(), _read_list(tokens, next(tokens)))

"""Limits of a job file's YAML, checked on the events of its parser, before anything is expanded."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from damageest.errors import Fault, JobError

MOST_BYTES = 1024 * 1024
"""Largest size of a job file."""
MOST_VALUES = 20_000
"""Largest number of values of a job, with each alias counted as often as it is used."""
MOST_DEPTH = 50
"""Largest number of lists and mappings inside each other."""


def check_events(events: Iterable[Any], source: str) -> None:
    """Raises JobError for a text whose values are too many or too deep, whose aliases stand for too many values or for
    themselves, and for tags, which name types of Python or of other programs.

    ``events``: those of ruamel.yaml's parser, which reads no further than the events that are requested.
    """
    open_nodes: list[tuple[str | None, int]] = []  # the anchor of each open list or mapping, and the count before it
    known: dict[str, int] = {}
    count, has_alias = 0, False
    for event in events:
        kind = type(event).__name__
        anchor: str | None = getattr(event, "anchor", None)
        if getattr(event, "tag", None):
            raise _refuse(event, f"the tag {_shorten(event.tag)} means nothing in a job; remove it", source)
        if kind == "AliasEvent":
            has_alias = True
            unfinished = any(anchor == name for name, _ in open_nodes)
            count += MOST_VALUES if unfinished else known.get(str(anchor), 0)
        elif kind in ("ScalarEvent", "SequenceStartEvent", "MappingStartEvent"):
            count += 1
            if kind != "ScalarEvent":
                open_nodes.append((anchor, count - 1))
            elif anchor is not None:
                known[anchor] = 1
        elif kind in ("SequenceEndEvent", "MappingEndEvent"):
            name, before = open_nodes.pop()
            if name is not None:
                known[name] = count - before
        if len(open_nodes) > MOST_DEPTH:
            raise _refuse(event, f"more than {MOST_DEPTH} lists and mappings inside each other", source)
        if count > MOST_VALUES:
            text = f"its aliases stand for more than {MOST_VALUES} values, or contain themselves; write the values out"
            if not has_alias:
                text = f"more than {MOST_VALUES} values, which no job has"
            raise _refuse(event, text, source)


def find_bad_character(text: str) -> str:
    """Why a text cannot be the name of a file; empty where it can."""
    if "\0" in text:
        return "has a NUL character, which no name or path can have"
    if any("\ud800" <= letter <= "\udfff" for letter in text):
        return "has half of a surrogate pair, which is not a character"
    return ""


def _shorten(tag: object) -> str:
    return str(tag).replace("tag:yaml.org,2002:", "!!")[:60]


def _refuse(event: Any, message: str, source: str) -> JobError:
    mark = event.start_mark
    return JobError([Fault(message, "", mark.line + 1, mark.column + 1)], source)

"""Reads a YAML 1.2 file into plain values, with the line and column of every key; writes plain values back."""

from __future__ import annotations

import io
from collections.abc import Mapping
from datetime import date, datetime
from pathlib import Path
from typing import Any

from damageest.errors import Fault, JobError
from damageest.job.yaml_limits import MOST_BYTES, check_events, find_bad_character

Positions = dict[tuple[str | int, ...], tuple[int, int]]
"""Path of keys and indices to the (line, column) where the key or item stands, from 1."""


def read(path: Path) -> tuple[Any, Positions]:
    """The file's content and the position of each key. Raises JobError for a file that cannot be read or parsed."""
    if wrong := find_bad_character(str(path)):
        raise JobError([Fault(f"its name {wrong}")], ascii(str(path)))
    try:
        return parse(_read_text(path), str(path))
    except OSError as error:
        raise JobError([Fault(f"cannot be read: {error.strerror or error}")], str(path)) from None


def _read_text(path: Path) -> str:
    if path.is_dir():
        jobs = sorted(one.name for one in path.iterdir() if one.suffix in (".yaml", ".yml"))
        listed = ", ".join(jobs[:5]) + (", ..." if len(jobs) > 5 else "")
        hint = f"name its job files, for example {path / '*.yaml'}; it has {listed}" if jobs else "it has no .yaml file"
        raise JobError([Fault(f"is a folder, not a job file; {hint}")], str(path))
    if path.exists() and not path.is_file():
        raise JobError([Fault("is not a regular file; a job is a YAML file on disk")], str(path))
    try:
        if path.stat().st_size > MOST_BYTES:
            raise JobError([Fault(f"is larger than {MOST_BYTES // 1024} kB, so it is not a job file")], str(path))
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise JobError([Fault("there is no such file")], str(path)) from None
    except UnicodeDecodeError as error:
        raise JobError([Fault(f"cannot be read as a text file: {error}")], str(path)) from None


def parse(text: str, source: str) -> tuple[Any, Positions]:
    """As `read`, from a text; ``source`` is what errors call it."""
    from ruamel.yaml import YAML
    from ruamel.yaml.constructor import DuplicateKeyError
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        check_events(YAML(typ="rt").parse(text), source)
        tree = YAML(typ="rt").load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = (error.problem or error.context or "not valid YAML").splitlines()[0]
        if isinstance(error, DuplicateKeyError):
            message = message.split(" with value")[0] + ": remove one of the two"
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        raise JobError([Fault(f"not valid YAML: {message}", "", line, column)], source) from None
    except (YAMLError, ValueError, RecursionError) as error:
        raise JobError([Fault(f"not valid YAML: {str(error).splitlines()[0]}")], source) from None
    positions: Positions = {}
    plain = _to_plain(tree, (), positions)
    faults = [
        Fault(f"this value {wrong}", ".".join(map(str, place)), *positions.get(place, (1, 1)))
        for place, text in _find_texts(plain, ())
        if (wrong := find_bad_character(text))
    ]
    if faults:
        raise JobError(faults, source)
    return plain, positions


def _find_texts(node: Any, path: tuple[str | int, ...]) -> list[tuple[tuple[str | int, ...], str]]:
    if isinstance(node, Mapping):
        return [found for key, value in node.items() for found in _find_texts(value, (*path, key))]
    if isinstance(node, list):
        return [found for index, value in enumerate(node) for found in _find_texts(value, (*path, index))]
    return [(path, node)] if isinstance(node, str) else []


def _to_plain(node: Any, path: tuple[str | int, ...], positions: Positions) -> Any:
    if isinstance(node, Mapping):
        for key in node:
            try:
                line, column = node.lc.key(key)  # type: ignore[attr-defined]
            except (KeyError, TypeError, AttributeError):
                continue  # it is merged from another mapping
            positions[(*path, str(key))] = (line + 1, column + 1)
        return {str(key): _to_plain(value, (*path, str(key)), positions) for key, value in node.items()}
    if isinstance(node, list):
        for index in range(len(node)):
            line, column = node.lc.item(index)  # type: ignore[attr-defined]
            positions[(*path, index)] = (line + 1, column + 1)
        return [_to_plain(value, (*path, index), positions) for index, value in enumerate(node)]
    for kind in (bool, int, float, str):
        if isinstance(node, kind):
            return kind(node)
    return node.isoformat() if isinstance(node, date) and not isinstance(node, datetime) else node


def write(value: Any) -> str:
    """YAML text of plain values; lists of numbers on one line."""
    from ruamel.yaml import YAML
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    def styled(node: Any) -> Any:
        if isinstance(node, Mapping):
            return CommentedMap((key, styled(item)) for key, item in node.items())
        if isinstance(node, (list, tuple)):
            items = CommentedSeq(styled(item) for item in node)
            if all(isinstance(item, (int, float)) for item in node):
                items.fa.set_flow_style()
            return items
        return node

    yaml = YAML()
    yaml.width = 120
    yaml.indent(mapping=2, sequence=4, offset=2)
    stream = io.StringIO()
    yaml.dump(styled(value), stream)
    return stream.getvalue()

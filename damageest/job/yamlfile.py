"""Reads a YAML 1.2 file into plain values, with the line and column of every key; writes plain values back."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from damageest.errors import Fault, JobError

Positions = dict[tuple[str | int, ...], tuple[int, int]]
"""Path of keys and indices to the (line, column) where the key or item stands, from 1."""


def read(path: Path) -> tuple[Any, Positions]:
    """The file's content and the position of each key. Raises JobError for a file that cannot be read or parsed."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise JobError([Fault("there is no such file")], str(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise JobError([Fault(f"cannot be read as a text file: {error}")], str(path)) from None
    return parse(text, str(path))


def parse(text: str, source: str) -> tuple[Any, Positions]:
    """As `read`, from a text; ``source`` is what errors call it."""
    from ruamel.yaml import YAML
    from ruamel.yaml.constructor import DuplicateKeyError
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
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
    return _to_plain(tree, (), positions), positions


def _to_plain(node: Any, path: tuple[str | int, ...], positions: Positions) -> Any:
    if isinstance(node, Mapping):
        for key in node:
            line, column = node.lc.key(key)  # type: ignore[attr-defined]
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
    return node


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

"""What commands print for programs (``--json``), in one form for all of them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

SCHEMA = 1
"""Version of what is printed: fields keep their names and meanings as long as it is the same; new ones may come."""


def format_json(content: Mapping[str, Any]) -> str:
    """One line: an object with ``schema`` first. Numbers that JSON lacks, such as infinity, become null; arrays, sets
    and tuples lists, paths text."""
    return json.dumps({"schema": SCHEMA, **_plain(content)}, ensure_ascii=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, set | frozenset):
        return [_plain(one) for one in sorted(value)]
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return value.as_posix() if isinstance(value, Path) else str(value)

"""One run in a process of its own."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from damageest.errors import clean_message
from damageest.isolation import Limits, ProcessError, call_isolated

Row = dict[str, Any]


def run_in_process(function: Callable[..., Row], arguments: Mapping[str, Any], timeout: float) -> Row | str:
    """The row of ``function(**arguments)``, as JSON gives it back; a message where it raised, crashed, or took longer
    than ``timeout`` seconds."""
    limits = Limits(seconds=timeout, of="case", option="--timeout")
    try:
        row = call_isolated(function, arguments, limits=limits, show=False, stays=False, nested=True)
    except ProcessError as error:
        return error.message
    except Exception as error:
        return f"the process raised {type(error).__name__}: {clean_message(error, 400)}"
    stored: Row = json.loads(json.dumps(row))  # as a file of rows holds it
    return stored

"""What is wrong with a job, in the words of a job file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from damageest.errors import suggest


def describe_fault(fault: Any, values: Any, valid: Sequence[str] = (), owner: str = "") -> str:
    """A pydantic error in the words of a job file."""
    name = str(fault["loc"][-1]) if fault["loc"] else ""
    if fault["type"] == "extra_forbidden" and len(fault["loc"]) == 1:
        options = f"its options are: {', '.join(valid)}" if valid else "it has no options"
        return f"'{owner}' has no option '{name}'{suggest(name, valid)}; {options}"
    if fault["type"] == "extra_forbidden":
        return f"unknown option '{name}'"
    if fault["type"] == "missing" and isinstance(fault["loc"][-1], int):
        return f"the list is too short: value {fault['loc'][-1] + 1} is missing"
    if fault["type"] == "missing" and len(fault["loc"]) > 1:
        return f"missing: give  {name}: ..."
    if fault["type"] == "missing":
        return f"'{owner}' needs  {name}: ..."
    if fault["type"] == "format":  # its text names what was given
        return str(fault["msg"])
    given = fault.get("input")
    shown = f", not {given!r}" if isinstance(given, (str, int, float, bool, type(None))) else ""
    if fault["type"] == "path_type":
        return f"expected the path of a file{shown}"
    if fault["type"] == "tuple_type":
        return f"expected a list{shown}"
    message = str(fault["msg"]).removeprefix("Value error, ")
    if fault["type"] == "literal_error":
        expected = fault["ctx"]["expected"]
        choices = [part.strip("' ") for part in expected.replace(" or ", ", ").split(",")]
        return f"expected {expected}{shown}{suggest(str(given), choices)}"
    return message[:1].lower() + message[1:] + shown

"""Functions that the Numba library compiles. What it has compiled is kept beside their file, or in the user's cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

MOST_TRIES = 50
"""Compiled functions, each for some kinds of values, that one may call."""


def compile_loops(function: Callable[P, R]) -> Callable[P, R]:
    """The function, compiled when it is first called; in each process anew where no folder can be written."""
    try:
        return cast("Callable[P, R]", numba.njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # no folder to keep it in
        return cast("Callable[P, R]", numba.njit(error_model="numpy")(function))


def run_loops(function: Callable[P, R], *given: P.args, **named: P.kwargs) -> R:
    """What a compiled function gives, also where what is compiled cannot be kept, as on a full disk: Numba raises
    OSError then for each function that it has just compiled, and does not compile it again."""
    for _ in range(MOST_TRIES):
        try:
            return function(*given, **named)
        except OSError:
            continue
    return function(*given, **named)

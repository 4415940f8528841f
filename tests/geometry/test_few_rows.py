"""Every public function of the toolbox with 0, 1 and 2 rows: an answer of the right shape, or a refusal in words.

A scan can be small, and a selection of points or triangles empty, anywhere in a run. numpy's own error on an empty
array, from deep within, tells nobody what happened.
"""

from __future__ import annotations

import importlib
import inspect
import itertools
import pkgutil
import re
import warnings
from collections.abc import Iterable

import numpy as np
import pytest

import damageest.geometry
from damageest.artefacts import Mesh
from damageest.errors import InputError, StageError
from tests.geometry.few_rows import Rows
from tests.geometry.few_rows_calls import CALLS, REFUSALS, WITHOUT_ROWS


def list_public() -> set[str]:
    """Functions and classes that the modules of the toolbox define, by module and name."""
    found = set()
    for info in pkgutil.iter_modules(damageest.geometry.__path__):
        module = importlib.import_module(f"damageest.geometry.{info.name}")
        for name, value in vars(module).items():
            is_own = getattr(value, "__module__", "") == module.__name__
            if not name.startswith("_") and is_own and (inspect.isfunction(value) or inspect.isclass(value)):
                found.add(f"{info.name}.{name}")
    return found


def test_each_public_name_is_called_here_or_takes_no_rows() -> None:
    assert list_public() == CALLS.keys() | WITHOUT_ROWS.keys()
    assert not CALLS.keys() & WITHOUT_ROWS.keys()
    assert REFUSALS.keys() <= CALLS.keys()


COUNTS = list(itertools.product(range(3), range(3)))
"""Numbers of points and of triangles."""
KINDS = [(0.0, False, 0), (1e4, True, 2)]
"""How far the rows are from the origin, whether all points are in one place, and how many vertices no triangle uses."""


def make_rows(count: int, triangles: int, away: float, in_one_place: bool, lone: int) -> Rows:
    rng = np.random.default_rng(10 * count + triangles)
    points = away + rng.uniform(-4, 4, (count, 3))
    if in_one_place:
        points[:] = points[:1]
    vertices = away + rng.uniform(-4, 4, (3 * triangles + lone, 3))
    return Rows(points, Mesh(vertices, np.arange(3 * triangles).reshape(-1, 3)), rng)


def find_refusal(name: str, some: Rows) -> Exception | None:
    """The error by which the function refuses, None where it answers. Other errors and warnings are raised."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy warns of the mean of nothing
        try:
            CALLS[name](some)
        except (ValueError, InputError, StageError) as error:
            return error
    return None


def check_rows(name: str, kinds: Iterable[tuple[float, bool, int]]) -> None:
    for (count, triangles), kind in itertools.product(COUNTS, kinds):
        refusal = find_refusal(name, make_rows(count, triangles, *kind))
        expected = REFUSALS.get(name, "no refusal is listed")
        told = f"{count} points, {triangles} triangles, {kind}: {refusal!r}"
        assert not refusal or re.search(expected, str(refusal)), told


@pytest.mark.variants(25)
@pytest.mark.parametrize("name", CALLS)
def test_few_rows_have_an_answer_or_a_refusal_in_words(name: str) -> None:
    check_rows(name, KINDS)


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_few_rows_of_all_kinds(name: str) -> None:
    check_rows(name, list(itertools.product((0.0, 1e4), (False, True), (0, 2))))


@pytest.mark.parametrize("name", REFUSALS)
def test_a_refusal_stands_in_the_docstring(name: str) -> None:
    module, function = name.split(".")
    value = getattr(importlib.import_module(f"damageest.geometry.{module}"), function)
    members = list(vars(value).values()) if inspect.isclass(value) else []
    text = "\n".join(inspect.getdoc(each) or "" for each in (value, *members))
    assert re.search(r"Raises\s+\w+Error", text), name

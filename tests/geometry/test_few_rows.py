"""Every public function of the toolbox with 0, 1 and 2 rows: an answer of the right shape, or a refusal in words.

A scan can be small, and a selection of points or triangles empty, anywhere in a run. numpy's own error on an empty
array, from deep within, tells nobody what happened.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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


@st.composite
def rows(draw: st.DrawFn) -> Rows:
    count, triangles = draw(st.integers(0, 2)), draw(st.integers(0, 2))
    rng = np.random.default_rng(draw(st.integers(0, 5)))
    away = draw(st.sampled_from([0.0, 1e4]))
    points = away + rng.uniform(-4, 4, (count, 3))
    if draw(st.booleans()):
        points[:] = points[:1]  # in one place
    lone = draw(st.sampled_from([0, 2]))  # vertices that no triangle uses
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


@pytest.mark.parametrize("name", CALLS)
@settings(max_examples=25, deadline=None, derandomize=True, database=None)
@given(some=rows())
def test_few_rows_have_an_answer_or_a_refusal_in_words(name: str, some: Rows) -> None:
    refusal = find_refusal(name, some)
    assert not refusal or re.search(REFUSALS.get(name, "no refusal is listed"), str(refusal)), repr(refusal)


@pytest.mark.parametrize("name", REFUSALS)
def test_a_refusal_stands_in_the_docstring(name: str) -> None:
    module, function = name.split(".")
    value = getattr(importlib.import_module(f"damageest.geometry.{module}"), function)
    members = list(vars(value).values()) if inspect.isclass(value) else []
    text = "\n".join(inspect.getdoc(each) or "" for each in (value, *members))
    assert re.search(r"Raises\s+\w+Error", text), name

"""A rotary axis that would come to its limit is turned back between two passes, away from the part."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_machines.build import build_program
from damageest_machines.definition import Machine
from damageest_machines.files import find_file
from damageest_machines.moves import TURNED_BACK
from machine_checks import compare, load, read, write
from machine_readers import axis_of

from damageest.artefacts import DepositPath, Mesh
from damageest.errors import StageError
from damageest.stages.export import PathSettings

HEAD = "sinumerik_head_head"
TIP = Mesh(np.array([[0, 0, 0], [8, 0, 30], [-8, 8, 30], [-8, -8, 30.0]]), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]]))
STANDOFF = 6.0


def make_rounds(count: int, free: bool = True, slant: float = 35.0) -> DepositPath:
    """``count`` passes round a shaft of radius 20 along z, each a whole turn in the same sense, the tool leaning."""
    angle = np.radians(np.arange(0, 361, 5))
    points, axes, on, number = [], [], [], []
    for each in range(count):
        turn = np.column_stack([np.cos(angle), np.sin(angle)])
        points.append(np.column_stack([20 * turn, np.full(len(turn), float(each))]))
        lean = np.radians(slant)
        axes.append(np.column_stack([np.sin(lean) * turn, np.full(len(turn), np.cos(lean))]))
        on.append(np.arange(len(turn)) > 0)
        number.append(np.full(len(turn), each + 1))
    numbers = np.concatenate(number)
    rows = len(numbers)
    return DepositPath(
        np.concatenate(points), np.concatenate(axes), np.tile([0, 0, 1.0], (rows, 1)), np.full(rows, 600.0),
        np.concatenate(on), numbers, numbers, np.ones(rows, int), np.array([[0, 0, 1.0]]), np.array([1.0]), 2.0,
        np.array([2.0]), STANDOFF, 80.0, TIP, 1.0, 1.0, around=np.array([0, 0, 0, 40.0]),
        free_ends=np.full(count, free),
    )  # fmt: skip


def build(path: DepositPath, **changes: Any) -> Any:
    return build_program(path, PathSettings("mm", "test site 1"), Machine.model_validate({**load(HEAD), **changes}))


def test_c_is_turned_back_and_the_program_follows_the_path(tmp_path: Path) -> None:
    """C goes from -90 to 270 degrees in each round, and the head ends at 360."""
    path = make_rounds(5)
    text, notes = write("sinumerik", HEAD, path, tmp_path)
    assert any("turned back 4 times" in note for note in notes)
    off = compare(path, read("sinumerik", HEAD, text))
    assert off.point < 1e-3
    assert off.axis < 1e-3


def test_the_axes_stay_within_their_limits_and_never_jump() -> None:
    program = build(make_rounds(5))
    values = load(HEAD)
    names = [axis["name"] for axis in values["rotary"]]
    for number, axis in enumerate(values["rotary"]):
        low, high = axis["limits"]
        assert low - 1e-6 <= program.at.rotary[:, number].min()
        assert program.at.rotary[:, number].max() <= high + 1e-6
    assert np.abs(np.diff(program.at.rotary, axis=0)).max() < 20
    found = np.array([axis_of(values, dict(zip(names, row, strict=True))) for row in program.at.rotary.tolist()])
    assert np.abs(found - program.moves.axes).max() < 1e-6


def test_the_tool_turns_only_where_all_of_it_is_clear_of_what_is_around() -> None:
    path = make_rounds(4)
    assert path.around is not None
    program = build(path)
    back = np.flatnonzero(program.moves.source == TURNED_BACK)
    assert len(back)
    assert not program.moves.on[back].any()
    reach = float(np.linalg.norm(TIP.vertices + np.array([0, 0, STANDOFF]), axis=1).max())
    away = np.linalg.norm(program.moves.points - path.around[:3], axis=1)
    for before, k in pairwise(range(len(away))):
        turned = np.abs(program.moves.axes[k] - program.moves.axes[before]).max() > 1e-6
        if program.moves.source[k] == TURNED_BACK and turned:
            assert away[k] >= path.around[3] + reach - 1e-6
            assert np.allclose(program.moves.points[k], program.moves.points[before])


def test_without_a_free_way_out_it_is_refused() -> None:
    with pytest.raises(StageError, match="would have to jump"):
        build(make_rounds(5, free=False))


def test_a_path_that_fits_is_not_changed() -> None:
    program = build(make_rounds(1))
    assert not (program.moves.source == TURNED_BACK).any()
    assert not program.notes


def test_vectors_turn_an_axis_back_only_where_the_tool_leans(tmp_path: Path) -> None:
    """A leaning tool sweeps a cone, which vectors describe; from a vector that stays, no control turns C."""
    file = tmp_path / "vectors.yaml"
    text = find_file(HEAD).read_text(encoding="utf-8")
    file.write_text(text.replace("orientation: axes", "orientation: vectors"), encoding="utf-8")
    leaning = make_rounds(3)
    written, _ = write("sinumerik", file, leaning, tmp_path)
    assert compare(leaning, read("sinumerik", file, written)).axis < 1e-3
    axes = leaning.axes.copy()
    axes[np.flatnonzero(leaning.on & ~np.append(leaning.on[1:], False))] = [0, 0, 1]
    with pytest.raises(StageError, match="other rotary angles"):
        write("sinumerik", file, replace(leaning, axes=axes), tmp_path)

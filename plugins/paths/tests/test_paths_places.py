"""The process by place: bends, width of the metal, time since the neighbour, waits between beads, and trials."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_paths.layers import Layers
from damageest_paths.process.calibration import Trial, predict_beads
from damageest_paths.process.interpass import add_waits, measure_rest
from damageest_paths.process.places import cut_moves, measure_radius, measure_widths
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from pydantic import ValidationError

from damageest.artefacts import DepositPath, Floats
from damageest.errors import StageError
from damageest.stages.export import PathSettings
from damageest.stages.export.path_apt import write_apt
from damageest.stages.export.path_csv import write_csv
from damageest.stages.export.rs274 import write_rs274
from tests.path_shapes import BLOCK, OPTIONS, Loss, cut, dent, plan

UP = (0.0, 0.0, 1.0)
TRIALS: list[dict[str, Any]] = [
    {"set": {"speed": 400.0, "power": 1000.0}, "width": 2.2, "height": 1.2},
    {"set": {"speed": 800.0, "power": 1000.0}, "width": 1.8, "height": 0.8},
    {"set": {"speed": 400.0, "power": 1500.0}, "width": 2.6, "height": 1.3},
    {"set": {"speed": 800.0, "power": 1500.0}, "width": 2.0, "height": 0.9},
]


@cache
def plan_rings(**options: float) -> DepositPath:
    return plan(dent(), direction=UP, simulate=False, pattern="contour", **options)


def wall() -> Loss:
    """The upper edge of a wall 6 thick."""
    part = Manifold.cube((6, 40, 30)).translate((-3, -20, -30))
    return cut(part, Manifold.cube((6, 30, 3)).translate((-3, -15, -3)))


def pad() -> Loss:
    """A corner of a block, 3 high, open to two sides."""
    return cut(BLOCK, Manifold.cube((24, 18, 3)).translate((-4, -3, -3)))


def lay_out(path: DepositPath) -> tuple[Floats, Floats]:
    """The middles (N,3) of moves and the times (N,) at which they are laid, in seconds."""
    middles, times, now = [path.points[0]], [0.0], 0.0
    for k in range(1, len(path.points)):
        if path.dwell is not None:
            now += float(path.dwell[k - 1])
        spent = 60 * float(path.moves[k] / path.feed[k])
        middles.append((path.points[k - 1] + path.points[k]) / 2)
        times.append(now + spent / 2)
        now += spent
    return np.array(middles), np.array(times)


def find_rest(path: DepositPath) -> Floats:
    """As `measure_rest`, one pair after the other."""
    middles, times = lay_out(path)
    found = np.full(len(times), np.inf)
    height = path.heights[0]
    for k in np.flatnonzero(path.on):
        for m in np.flatnonzero(path.on[:k] & (path.number[:k] != path.number[k])):
            away = middles[k] - middles[m]
            rise = away @ path.normals[k]
            is_beside = np.linalg.norm(away - rise * path.normals[k]) <= 1.1 * path.width
            if is_beside and -0.5 * height <= rise <= 1.5 * height:
                found[k] = min(found[k], times[k] - times[m])
    return found


@pytest.mark.slow
def test_rings_bend_as_they_are_wide() -> None:
    path, _ = cut_moves(plan_rings())
    found = measure_radius(path)
    middles, _ = lay_out(path)
    # the dent is round about z
    radius = np.hypot(middles[:, 0], middles[:, 1])
    own = path.on & (radius > 4) & (np.array(path.kinds)[path.number - 1] == "ring")
    assert own.sum() > 100
    off = found[own] / radius[own]
    assert 0.9 < np.median(off) < 1.1
    straight, _ = cut_moves(plan(pad(), direction=UP, simulate=False))
    assert np.isinf(measure_radius(straight)[straight.on]).mean() > 0.4  # the corners of rows are rounded


def test_the_metal_is_as_wide_as_the_wall() -> None:
    loss = wall()
    path, _ = cut_moves(plan(loss, direction=UP, simulate=False))
    found = measure_widths(path, loss.lost, loss.left)
    assert np.allclose(found[path.on], 6.0, atol=1e-3)
    assert np.isinf(found[~path.on]).all()
    wide, _ = cut_moves(plan_rings())
    loss = dent()
    assert measure_widths(wide, loss.lost, loss.left)[wide.on].min() > 20


@pytest.mark.slow
def test_the_time_since_the_neighbour_is_that_of_all_pairs() -> None:
    path, _ = cut_moves(plan_rings())
    some = path.number <= 6
    own = {
        name: getattr(path, name)[some]
        for name in ("points", "axes", "normals", "feed", "on", "layer", "number", "part")
    }
    path = replace(path, **own, kinds=path.kinds[:6], free_ends=None)
    found, expected = measure_rest(path), find_rest(path)
    both = np.isfinite(found) & np.isfinite(expected)
    assert both.sum() > 50
    assert (np.isfinite(found) == np.isfinite(expected)).mean() > 0.97
    # places are a quarter of a bead apart at most: 0.5 long at 10 a second; round a corner another may be the last
    assert np.quantile(np.abs(found[both] - expected[both]), 0.98) < 0.3


@pytest.mark.variants(1)
@pytest.mark.parametrize("least", [5.0, 40.0])
def test_neighbours_have_the_time_to_cool_down(least: float) -> None:
    before, path = plan_rings(), plan_rings(interpass=least)
    assert path.dwell is not None
    assert measure_rest(cut_moves(before)[0]).min() < least
    assert measure_rest(cut_moves(path)[0]).min() == pytest.approx(least, abs=1e-6)
    assert not path.dwell[path.on].any()
    assert path.minutes == pytest.approx(replace(path, dwell=None).minutes + path.dwell.sum() / 60)
    assert any("cool down" in note for note in path.notes) == (least > 10)
    # no wait is longer than that after the bead before
    assert path.dwell.max() <= least


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("loss", "pattern"),
    [
        (wall, "zigzag"),
        (pad, "contour"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in ((wall, "contour"), (dent, "zigzag"), (dent, "contour"))
        ),
    ],
)
def test_the_order_of_passes_leaves_beads_time(loss: Any, pattern: str) -> None:
    """Against the order with the shortest ways, with waits in it."""
    short = plan(loss(), direction=UP, simulate=False, pattern=pattern)
    cool = plan(loss(), direction=UP, simulate=False, pattern=pattern, interpass=20.0)
    assert cool.length == pytest.approx(short.length, rel=1e-6)
    waited = add_waits(cut_moves(short)[0], 20.0)
    assert cool.minutes < 0.99 * waited.minutes
    assert cool.travel > short.travel


def test_the_last_row_that_holds_for_a_place_counts() -> None:
    table = [
        {"set": {"power": 1200.0}},
        {"radius": {"most": 6.0}, "set": {"power": 900.0, "speed": 400.0}},
        {"rest": {"most": 8.0}, "set": {"power": 1000.0}},
        {"thickness": {"least": 5.0}, "layer": 1, "set": {"gas": 3.0}},
        {"set": {"gas": 3.0}},
    ]
    path = plan(dent(), direction=UP, simulate=False, pattern="contour", process=table)
    plain = plan_rings()
    assert path.values is not None
    cool, _ = cut_moves(path)
    radius, rest = measure_radius(cool), measure_rest(cool)
    own = cool.on
    assert cool.values is not None or cool.channels
    expected = np.where(rest < 8, 1000.0, np.where(radius < 6, 900.0, 1200.0))[own]
    # moves are cut again at other places where some were joined: only near the borders that differs
    rows = np.searchsorted(np.cumsum(path.moves), np.cumsum(cool.moves) - 1e-9)
    assert (path.values[rows][own, 0] == expected).mean() > 0.97
    assert set(np.unique(path.values[path.on, 0])) == {900.0, 1000.0, 1200.0}
    feed = path.feed * path.sizes[:, 1] / path.planned_sizes[:, 1]
    assert set(np.round(feed[path.on], 6)) == {400.0, 600.0}
    assert path.length == pytest.approx(plain.length)
    assert {tuple(point) for point in plain.points.tolist()} <= {tuple(point) for point in path.points.tolist()}
    # travel leads to what the pass begins with
    starts = np.flatnonzero(~path.on[:-1] & path.on[1:])
    assert np.array_equal(path.values[starts], path.values[starts + 1])


@pytest.mark.slow
def test_files_have_waits_and_beads(tmp_path: Path) -> None:
    path = plan(dent(), direction=UP, simulate=False, interpass=30.0, calibration=TRIALS, process=[
        {"set": {"power": 1000.0}}, {"layer": 1, "set": {"power": 1500.0}},
    ])  # fmt: skip
    assert path.dwell is not None
    assert path.bead_sizes is not None
    write_csv(tmp_path / "a.csv", path, PathSettings("mm", "a"))
    head, *rows = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()]
    table = {name: [row[k] for row in rows] for k, name in enumerate(head)}
    assert np.allclose(np.array(table["dwell"], float), path.dwell, atol=5e-4)
    assert np.allclose(np.array([table["width"], table["height"]], float).T, path.bead_sizes, rtol=1e-5)
    first = path.on & (path.layer == 1)
    assert np.allclose(path.bead_sizes[first], [2.3, 1.1])  # half way between 400 and 800
    assert np.allclose(path.bead_sizes[path.on & ~first], [2.0, 1.0])
    write_apt(tmp_path / "a.apt", path, PathSettings("mm", "a"))
    write_rs274(tmp_path / "a.ngc", path, PathSettings("mm", "a"))
    for name, word, move in (("a.apt", "DELAY/", "GOTO"), ("a.ngc", "G4 P", "G1")):
        lines = (tmp_path / name).read_text().splitlines()
        waits = [float(line.removeprefix(word)) for line in lines if line.startswith(word)]
        assert np.allclose(waits, path.dwell[path.dwell > 0], atol=5e-4)
        for line, after in pairwise(lines):
            if after.startswith(word):
                assert line.startswith((move, "G0"))


@settings(max_examples=50, deadline=None)
@given(st.floats(400, 800), st.floats(1000, 1500))
def test_beads_between_trials_are_linear(speed: float, power: float) -> None:
    """Trials on a plane give the plane."""
    table = [
        Trial.model_validate({**row, "width": 3 - row["set"]["speed"] / 800 + row["set"]["power"] / 1000})
        for row in TRIALS
    ]
    ((width, height),) = predict_beads(table, {"speed": np.array([speed]), "power": np.array([power])})
    assert width == pytest.approx(3 - speed / 800 + power / 1000)
    assert 0.8 - 1e-9 <= height <= 1.3 + 1e-9


def test_a_row_beyond_the_trials_is_told_before_the_run() -> None:
    process = [{"set": {"power": 1250.0}}, {"layer": 3, "set": {"power": 900.0}}]
    with pytest.raises(ValidationError, match="power 900 is beyond the trials, which have 1000 to 1500"):
        Layers.model_validate({**OPTIONS, "calibration": TRIALS, "process": process})


def test_width_and_height_follow_from_trials() -> None:
    options: dict[str, Any] = {name: value for name, value in OPTIONS.items() if name not in ("width", "height")}
    with pytest.raises(ValidationError, match="width"):
        Layers.model_validate(options)
    process = [{"set": {"power": 1250.0}}]
    made = Layers.model_validate({**options, "calibration": TRIALS, "process": process})
    assert (made.width, made.height) == pytest.approx((2.15, 1.05), abs=0.051)
    made = Layers.model_validate({**OPTIONS, "calibration": TRIALS, "process": process})
    assert made.width == OPTIONS["width"]


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({"process": [{"set": {"power": 2000.0}}]}, "power 2000 is beyond the trials"),
        ({}, "the trials set power, which process does not"),
        (
            {"calibration": [TRIALS[0], TRIALS[3], {**TRIALS[0], "set": {"speed": 600.0, "power": 1250.0}}]},
            "do not vary",
        ),
        ({"calibration": [TRIALS[0], TRIALS[1], TRIALS[2]], "feed": 790.0}, "outside of all trials"),
    ],
)
def test_what_trials_do_not_know_is_refused(given_: dict[str, Any], words: str) -> None:
    process = [] if not given_ else [{"set": {"power": 1450.0}}]
    with pytest.raises((StageError, ValidationError), match=words):
        plan(dent(), direction=UP, simulate=False, **{"calibration": TRIALS, "process": process, **given_})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"calibration": [TRIALS[0], TRIALS[0]]}, "two rows have the same settings"),
        ({"calibration": [TRIALS[0], {**TRIALS[1], "set": {"speed": 3.0}}]}, "row 2 sets speed"),
        ({"process": [{"rest": {"least": 3.0}, "set": {"speed": 3.0}}]}, "may not depend on rest"),
        ({"process": [{"radius": {"least": 3.0, "most": 2.0}, "set": {"speed": 3.0}}]}, "has to be above least"),
        ({"process": [{"radius": {"most": 2.0}, "set": {"power": 3.0}}]}, "power: has no value for all passes"),
        ({"interpass": -1.0}, "interpass"),
    ],
)
def test_wrong_tables_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Layers.model_validate({**OPTIONS, **options})

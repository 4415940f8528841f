"""Parts of one type: their mean and spread are found through frames of their own and skin that is missing."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.geometry.families import build_family, leave_one_out, predict, widen
from damageest.geometry.transforms import find_nearest_motion, make_motions, move_points

RNG = np.random.default_rng(0)
PLACES = RNG.uniform(-1, 1, (400, 3)) * (20, 10, 5)
NORMALS = RNG.normal(size=(400, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1)[:, None]
HIDDEN = PLACES[:, 0] > 14
ERROR = 0.01


def make(amount: float, noise: float = 0.0, turn: int = -1) -> Floats:
    """A part with a common form and a bend of its own, in a frame of its own."""
    common = 0.5 * np.sin(PLACES[:, :1] / 6) * np.array([0.0, 1.0, 0.0])
    bend = amount * (PLACES[:, :1] / 20) ** 2 * np.array([0.0, 0.0, 1.0])
    rng = np.random.default_rng(turn + 1)
    T = make_motions(np.append(rng.normal(0, 0.01, 3), rng.normal(0, 0.2, 3))[None])[0] if turn >= 0 else np.eye(4)
    return move_points(PLACES + common + bend + noise * rng.normal(size=PLACES.shape), T)


AMOUNTS = np.array([0.6, 0.9, 1.0, 1.2, 1.5, 0.8])


@pytest.mark.parametrize("lost", [0, 2])
def test_a_part_is_predicted_where_it_is_hidden(lost: int) -> None:
    """Also where some of the others have lost the same, and what they say there is nonsense."""
    moved = np.stack([make(amount, turn=k) for k, amount in enumerate(AMOUNTS)])
    seen = np.ones(moved.shape[:2], bool)
    for k in range(lost):
        moved[k, HIDDEN] += 5.0
        seen[k, HIDDEN] = False
    family = build_family(PLACES, moved, seen, ERROR)
    true = make(1.3, turn=9)
    given = np.where(HIDDEN[:, None], 99.0, true)
    guess, _ = predict(family.mean, family.modes, given, ~HIDDEN, ERROR, NORMALS)
    assert np.abs(guess - true).max() < 0.02
    assert family.count[HIDDEN].max() == len(AMOUNTS) - lost


def test_leaving_one_out_tells_the_error() -> None:
    noise = 0.05
    moved = np.stack([make(amount, noise, k) for k, amount in enumerate([*AMOUNTS, *AMOUNTS + 0.1])])
    family = build_family(PLACES, moved, np.ones(moved.shape[:2], bool), ERROR)
    errors = leave_one_out(family, ~HIDDEN, NORMALS)
    told = float(np.sqrt((errors.beyond[:, HIDDEN] ** 2).mean()))
    true = make(1.1, noise, 50)
    guess, _ = predict(family.mean, family.modes, true, ~HIDDEN, ERROR, NORMALS)
    missed = float(np.sqrt(((guess - true)[HIDDEN] ** 2).mean()))
    assert told == pytest.approx(missed, rel=0.35)
    assert told > noise
    assert not errors.beyond[:, ~HIDDEN].any()


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 12])
def test_intervals_hold_over_many_families(count: int) -> None:
    """Parts that differ in four ways, of which one begins where they are hidden."""
    rng = np.random.default_rng(count)
    some, normals, hidden = PLACES[:120], NORMALS[:120], HIDDEN[:120]
    x = some[:, :1] / 20
    shapes = [x**2 * (0, 0, 1), np.sin(3 * x) * (0, 1, 0), np.maximum(x - 0.3, 0) ** 2 * (0, 0, 1)]
    ways = np.stack([*shapes, np.maximum(x - 0.65, 0) * (0, 0.7, 0.7)])

    def draw_part() -> Floats:
        return np.asarray(some + np.einsum("k,knc->nc", 1 + rng.normal(0, (0.3, 0.15, 0.2, 0.1)), ways))

    inside = []
    for _ in range(20):
        moved = np.stack([draw_part() for _ in range(count)])
        family = build_family(some, moved, np.ones(moved.shape[:2], bool), ERROR)
        errors, true = leave_one_out(family, ~hidden, normals), draw_part()
        guess, _ = predict(family.mean, family.modes, true, ~hidden, ERROR, normals)
        off = np.abs(np.einsum("nc,nc->n", true - guess, normals))
        spread = np.sqrt((np.einsum("knc,nc->kn", errors.beyond, normals) ** 2).mean(axis=0))
        inside.append((off <= widen(count) * 1.96 * spread)[hidden].mean())
    assert np.mean(inside) > 0.88


def test_one_part_says_how_a_part_may_be_deformed() -> None:
    family = build_family(PLACES, make(1.0)[None], np.ones((1, len(PLACES)), bool), ERROR)
    assert np.allclose(family.modes, (family.mean - PLACES)[None])


def test_the_nearest_motion() -> None:
    T = make_motions(np.array([[0.1, -0.2, 0.3, 1.0, 2.0, 3.0]]))[0]
    assert np.allclose(find_nearest_motion(PLACES, move_points(PLACES, T), (PLACES[:, 0] < 3).astype(float)), T)

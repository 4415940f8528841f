"""B-splines through functions of one or two parameters, with as many knots as they need to follow.

Lengths of curves and surfaces are those of the function's values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from damageest.artefacts import Floats

PLAIN, CURVED = 3, 5
"""Degrees: of what needs no more knots than it is given, and of everything else. The error of the latter falls by 64
with each halving."""
MOST_SPANS = 24
"""Spans along a parameter, beside those given, at which no more knots are inserted. OpenCASCADE's Boolean operations
get slow with more poles than that makes, and the error is far below what is asked for."""
LINES = 7
"""Lines across a surface along which its knots are chosen at first."""
BETWEEN = np.array([0.12, 0.35, 0.5, 0.65, 0.88])
"""Where in each span the error is measured."""

Curve = Callable[[Floats], Floats]
"""Gives the values (N,...) at parameters (N,)."""
Surface = Callable[[Floats, Floats], Floats]
"""Gives the values (N,M,3) at all pairs of parameters (N,) and (M,)."""


@dataclass(frozen=True)
class Axis:
    """``knots`` (K,), each once, with their ``repeats``, and the ``degree`` of a clamped B-spline."""

    degree: int
    knots: tuple[float, ...]
    repeats: tuple[int, ...]

    @property
    def vector(self) -> Floats:
        """The knots, each as often as it counts."""
        return np.repeat(np.array(self.knots), np.array(self.repeats))

    @property
    def places(self) -> Floats:
        """(N,) parameters, one for each pole, through which a B-spline can always be interpolated (Greville)."""
        vector, count = self.vector, sum(self.repeats) - self.degree - 1
        inner = np.stack([vector[1 + k : 1 + k + count] for k in range(self.degree)]).mean(axis=0)
        return np.asarray(np.clip(inner, vector[0], vector[-1]))

    @property
    def between(self) -> Floats:
        """(5 S,) parameters in the spans, to measure errors at."""
        knots = np.array(self.knots)
        return np.asarray((knots[:-1, None] + np.diff(knots)[:, None] * BETWEEN).ravel())


@dataclass(frozen=True, eq=False)
class Breaks:
    """Parameters ``at`` which a function is less smooth, from its first to its last, and how often it can be
    differentiated there, ``smooth``."""

    at: tuple[float, ...]
    smooth: tuple[int, ...]

    def start(self, degree: int) -> Axis:
        """The axis that has no other knots."""
        inner = [int(np.clip(degree - times, 1, degree)) for times in self.smooth[1:-1]]
        return Axis(degree, self.at, (degree + 1, *inner, degree + 1))


def interpolate_curve(curve: Curve, breaks: Breaks, aim: float) -> tuple[Axis, Floats, float]:
    """The axis and the poles (N,3) of the B-spline that follows a curve within ``aim``, and its largest error, which
    is more where the curve needs too many knots."""
    axis = choose_knots(curve, breaks, aim)
    poles = solve(axis, curve(axis.places))
    off = evaluate(axis, poles, axis.between) - curve(axis.between)
    return axis, poles, float(np.linalg.norm(off, axis=-1).max())


def interpolate_surface(
    surface: Surface, breaks: tuple[Breaks, Breaks], aim: float, most: int = MOST_SPANS
) -> tuple[tuple[Axis, Axis], Floats, float]:
    """Both axes and the poles (N,M,3) of the B-spline that follows a surface within ``aim``, and its largest error.

    ``most``: spans along each parameter, beside those given, at which no more knots are inserted.
    """
    lines = [np.linspace(one.at[0], one.at[-1], LINES) for one in breaks]
    found: tuple[tuple[Axis, Axis], Floats, float] | None = None
    for _ in range(2):
        along = choose_knots(partial(_take_lines, surface, lines[1]), breaks[0], aim / 2, most)
        across = choose_knots(partial(_take_lines, _swap(surface), lines[0]), breaks[1], aim / 2, most)
        poles = solve(along, surface(along.places, across.places))
        poles = solve(across, poles.swapaxes(0, 1)).swapaxes(0, 1)
        mixed = evaluate(along, poles, along.between)
        there = evaluate(across, mixed.swapaxes(0, 1), across.between).swapaxes(0, 1)
        off = float(np.linalg.norm(there - surface(along.between, across.between), axis=-1).max())
        if found is None or off < found[2]:
            found = (along, across), poles, off
        if (
            off <= aim
            or max(len(axis.knots) - len(one.at) for axis, one in zip(found[0], breaks, strict=True)) >= MOST_SPANS
        ):
            break
        lines = [along.places, across.places]  # what lies between the lines was missed
    assert found is not None
    return found


def _take_lines(surface: Surface, lines: Floats, at: Floats) -> Floats:
    return surface(at, lines)


def _swap(surface: Surface) -> Surface:
    return lambda v, u: surface(u, v).swapaxes(0, 1)


def choose_knots(curve: Curve, breaks: Breaks, aim: float, most: int = MOST_SPANS) -> Axis:
    """The axis with which the values (N,...,3) of a curve are interpolated within ``aim``, each span halved until they
    are, or until there are too many."""
    for degree in (PLAIN, CURVED):
        axis = breaks.start(degree)
        while True:
            poles = solve(axis, curve(axis.places))
            off = np.linalg.norm(evaluate(axis, poles, axis.between) - curve(axis.between), axis=-1)
            worst = off.reshape(len(axis.knots) - 1, -1).max(axis=1)
            late = np.flatnonzero(worst > aim)
            room = most + len(breaks.at) - len(axis.knots)
            if not len(late) or degree == PLAIN or room <= 0:
                break
            axis = halve_spans(axis, late[np.argsort(-worst[late], kind="stable")][:room].tolist())
        if not len(late):
            return axis
    return axis


def halve_spans(axis: Axis, spans: Sequence[int]) -> Axis:
    """The axis with a knot in the middle of some of its spans."""
    middles = [((axis.knots[k] + axis.knots[k + 1]) / 2, 1) for k in spans]
    rows = sorted([*zip(axis.knots, axis.repeats, strict=True), *middles])
    return Axis(axis.degree, tuple(knot for knot, _ in rows), tuple(times for _, times in rows))


def solve(axis: Axis, values: Floats) -> Floats:
    """The poles (N,...) of the B-spline that has the ``values`` (N,...) at the axis's places."""
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(axis.places, values, k=axis.degree, t=axis.vector).c)


def evaluate(axis: Axis, poles: Floats, at: Floats) -> Floats:
    """The values (K,...) at parameters (K,) of the B-spline of poles (N,...)."""
    from scipy.interpolate import BSpline

    return np.asarray(BSpline(axis.vector, poles, axis.degree)(at))

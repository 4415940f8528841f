"""Fields of growing freedom are fitted to the scan, and the one that held-out patches bear out is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.stages.adapt._choose import Score, Trial, cross_validate, cut_patches, explains_more, is_better
from damageest.stages.adapt._field import STIFF, Body, Field, Freedom, match
from damageest.stages.adapt._fit import fit

ROUNDS, LAST, HELD = 8, 10, 6
"""Rounds from the widest robust scale to the narrowest, more at the narrowest at most, and those of a fit to half of
the patches."""
WIDEST = 12.0
"""Widest robust scale, in tolerances."""
BENT = 0.001
"""Strain beyond that of a bend or a twist, of a field that does nothing else."""
RIGID, SCALED = Freedom(STIFF, grows=False, bends=False), Freedom(STIFF, bends=False)
STRAINED = (0.006, 0.03)
"""Strains beyond that of a bend or a twist that freer fields may have, in the order in which they are tried."""
LOOSEST = 0.1
"""The same where those leave much."""
NEAR = 0.006
"""Strain of a polynomial from which a lattice starts near it. Waves are no polynomial: the best one may be none, and
the skin far off."""
DOWN = 2.5
"""What a field leaves in half of the patches, in mean squares of the noise, up to which it explains the skin: those of
deformed parts leave 1.0 to 1.2, and one that swallows the wear of a real bore 56."""
FAR = 30.0
"""What the freest polynomial leaves, in the same, from which no lattice is tried."""
LEFT, SMALL = 1.15, 0.15
"""What a polynomial has to leave in half of the patches for freer fields: mean squares of the noise, and more by what
is not small, in tolerances. Errors that regions of a scan share are no form."""


class Climbed(NamedTuple):
    """The ``trials`` of fields, and the one that was ``chosen``, fitted to all points."""

    trials: list[Trial]
    chosen: Trial


def climb(
    points: Floats, body: Body, diagonal: float, tolerance: float, lattice: Sequence[int], strain: float
) -> Climbed:
    """The fields that were tried on half of the points (N,3), and the one that held-out patches bear out, fitted to all
    of them. ``lattice``: cells along the longest edge of the box of the lattices that may be tried. ``strain``: beyond
    it a field has to explain the skin down to the noise."""
    half = points[::2]
    ladder = _Ladder(half, body, choose_scales(half, body, tolerance), *cut_patches(half, diagonal), tolerance, strain)
    ladder.climb_stiff()
    ladder.climb_strained()
    for cells in lattice if ladder.is_near else ():
        ladder.climb_lattice(cells)
    chosen = ladder.chosen
    if chosen is ladder.trials[0]:
        return Climbed(ladder.trials, chosen)
    body = replace(body, basis=chosen.field.basis)
    fitted = fit(chosen.field, points, body, chosen.freedom, [ladder.scales[-1]] * LAST)
    return Climbed(ladder.trials, replace(chosen, field=fitted))


@dataclass(eq=False)
class _Ladder:
    """The trials so far on points (N,3), each in a ``patch`` (N,) of one of two halves (N,), ``held``, and the one that
    is ``chosen``. ``grows``: whether the scale is free; ``is_near``: whether a polynomial comes near the skin."""

    points: Floats
    body: Body
    scales: list[float]
    patch: Ints
    held: Flags
    tolerance: float
    strain: float
    is_near: bool = True
    trials: list[Trial] = field(default_factory=list)
    grows: bool = False
    chosen: Trial = field(init=False)

    def climb_stiff(self) -> None:
        """A rigid part, a scaled one, a bent and twisted one."""
        rigid, scaled = self._attempt(RIGID), self._attempt(SCALED)
        # nothing is strained by a scale, and shrinking leaves no metal outside
        self.chosen = scaled if explains_more(scaled.score.both, rigid.score.both)[0] else rigid
        self.grows = self.chosen is scaled
        self._take(self._attempt(Freedom(BENT, grows=self.grows)))
        if self.chosen is self.trials[-1] and not self.grows:
            self._take(self._attempt(Freedom(BENT)))
            self.grows = self.chosen is self.trials[-1]

    def climb_strained(self) -> None:
        """Polynomials that strain the metal, freer ones only where those before leave much."""
        freest = self._try(Freedom(STRAINED[-1], self.grows, stretches=True))
        self.is_near = self.strain >= STRAINED[-1] or self._leaves(freest) < FAR
        if not self.is_near:
            return
        if is_better(freest.score, self.chosen.score):
            for bound in STRAINED:
                self._take(self._attempt(Freedom(bound, self.grows)))
            self._take(freest)
        self.trials.append(freest)
        if self._leaves_much():  # as a taper of a thin part, which is of wear's kind
            self._take(self._attempt(Freedom(LOOSEST, self.grows)))
            self._take(self._attempt(Freedom(LOOSEST, self.grows, stretches=True)))

    def climb_lattice(self, cells: int) -> None:
        """A lattice, where the polynomials leave much."""
        whole = self.body
        finer = replace(whole, inside=whole.inside[::2], basis=replace(whole.basis, cells=cells))
        is_near = self.chosen.freedom.bound >= NEAR
        scales = self.scales[-1:] * ROUNDS if is_near else self.scales
        first = self.chosen.freedom if is_near else Freedom(STRAINED[-1], self.grows)
        for freedom in (first, Freedom(LOOSEST, self.grows, stretches=True)):
            if not self._leaves_much():
                return
            start = self.chosen.field.to_basis(finer.basis, np.concatenate([whole.inside, whole.mesh.vertices]))
            self._take(self._attempt(replace(freedom, cells=cells), start, scales, finer))

    def _leaves_much(self) -> bool:
        small = LEFT * self.body.noise**2 + (SMALL * self.tolerance) ** 2
        return bool(np.median(self.chosen.score.both) > small)

    def _leaves(self, trial: Trial) -> float:
        """What a field leaves in half of the patches, in mean squares of the noise."""
        return float(np.median(trial.score.both)) / self.body.noise**2

    def _take(self, trial: Trial) -> None:
        """Chooses a freer field where held-out patches bear it out, and the metal could follow it. Wear is no field of
        low order: one that swallows it leaves more than noise."""
        if is_better(trial.score, self.chosen.score):
            is_possible = trial.freedom.bound <= max(self.strain, BENT) or self._leaves(trial) < DOWN
            self.chosen = trial if is_possible else self.chosen

    def _attempt(
        self, freedom: Freedom, start: Field | None = None, scales: list[float] | None = None, body: Body | None = None
    ) -> Trial:
        self.trials.append(self._try(freedom, start, scales, body))
        return self.trials[-1]

    def _try(
        self, freedom: Freedom, start: Field | None = None, scales: list[float] | None = None, body: Body | None = None
    ) -> Trial:
        body = body or self.body
        fitted = fit(start or Field.zero(body.basis), self.points, body, freedom, scales or self.scales)
        score = cross_validate(fitted, self.points, body, freedom, self.scales[-1], HELD, self.patch, self.held)
        return Trial(fitted, freedom, score)


def choose_scales(points: Floats, body: Body, tolerance: float) -> list[float]:
    """The robust scales of a fit to points (N,3), from the widest to the narrowest, which comes more than once."""
    distance = np.abs(match(Field.zero(body.basis), points, body).distance)
    last = max(tolerance, 3 * body.noise)
    first = float(np.clip(3 * np.quantile(distance, 0.9), last, WIDEST * tolerance))
    return [*np.geomspace(first, last, ROUNDS), *[last] * LAST]


def score(found: Field, freedom: Freedom, points: Floats, body: Body, diagonal: float, tolerance: float) -> Score:
    """How well a field of some freedom explains held-out patches of half of the points (N,3)."""
    half, body = points[::2], replace(body, basis=found.basis)
    last = max(tolerance, 3 * body.noise)
    return cross_validate(found, half, body, freedom, last, HELD, *cut_patches(half, diagonal))

"""What certificate, temperature and a fitted scale say of the whole scan: an offset or a scale of it."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class _ByFigure(Term):
    """A source of which the job gives a figure."""

    def measure(self, case: LossCase) -> Share | None:
        found = case.by_figure.get(self.name)
        return None if found is None else Share(found.volume, found.depth, figure=found.figure)


class ProbingSize(_ByFigure):
    name = "probing_size"
    text = "probing size error: half of it is an offset of the surface"
    type = "B"
    rank = 110


class Length(_ByFigure):
    name = "length"
    text = "length measurement error over the part's diagonal, as a scale"
    type = "B"
    rank = 120


class Temperature(_ByFigure):
    name = "temperature"
    text = "temperature of the part"
    type = "B"
    rank = 130


class Expansion(_ByFigure):
    name = "expansion"
    text = "coefficient of expansion of the part"
    type = "B"
    rank = 140


class FittedScale(_ByFigure):
    name = "fitted_scale"
    text = "scale of the scan, fitted to the part"
    type = "A"
    rank = 150

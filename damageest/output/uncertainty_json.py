"""What result.json says about how exactly a site is known."""

from __future__ import annotations

from damageest.intervals import Budget, BudgetBound, BudgetRow, Fading, Uncertainty
from damageest.output.base import Bound, JsonModel

ReportedInterval = tuple[float, Bound]


class BudgetRowReport(JsonModel, of=BudgetRow):
    """A source of uncertainty, in the terms of JCGM 100 (GUM)."""


class BudgetBoundReport(JsonModel, of=BudgetBound):
    low: Bound
    high: Bound


class BudgetReport(JsonModel, of=Budget):
    """A budget of uncertainty. `bounds` are no part of it: they move the ends of the 95 % interval."""


class FadingReport(JsonModel, of=Fading):
    """Volumes of a shallow loss, counted only where it is deep enough."""


class UncertaintyReport(JsonModel, of=Uncertainty, without=("volume_95", "depth_95", "extrapolated_error", "certain")):
    """The causes. The first nine are standard deviations of the volume; `free`: its change at the ends of motions that
    the scan leaves free; the next two, how much larger it may be; `probing_form` and `scanner` are standard deviations
    again."""

"""The model fit in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.findings import DONE, ModelFit, ViewFit

LITTLE_SEEN = 0.5
"""Share of the skin that was seen, below which a fit that holds says little of the rest of the part."""


def describe_fit(
    fit: ModelFit, unit: str, tolerance: float, doubts: tuple[str, ...] = (), partly: str = ""
) -> ModelFit:
    """The fit with its ``words``: the model with its amounts, in the job's ``unit``. ``doubts``: what makes it open
    whether the part as designed explains the skin. ``partly``: what limits a fit that holds, of `describe_view_of`."""
    words = {
        "ok": f"the part as designed explains the intact skin{partly}",
        "open": f"cannot tell whether the part matches its CAD: {'; '.join(doubts)}",
        "scaled": _describe_scale(fit, unit),
        "deformed": _describe_deformation(fit, unit),
        "views disagree": _describe_views(fit, unit),
        "wavy": f"wavy skin: it deviates by {fit.waviness:.3g} {unit} (standard deviation) both ways over areas "
        f"wider than {20 * tolerance:.3g} {unit} (waviness of scanner or part)",
    }[fit.model]
    if fit.corrected_scale != 1:
        words = (
            f"the scale of the scan was corrected by {100 * (fit.corrected_scale - 1):+.3g} %, as the job says; {words}"
        )
    return replace(fit, words=words)


def describe_view_of(fit: ModelFit, seen: float, length: float, unit: str, tolerance: float) -> str:
    """What a fit that holds does not say, where little of the part was ``seen`` (share of its skin): as an addition to
    the fit's words, empty where it says enough. ``length``: of the part."""
    if seen >= LITTLE_SEEN:
        return ""
    hidden = abs(fit.scale - 1) + 2 * fit.scale_error
    words = f" that was seen, {100 * seen:.2g} % of the part's"
    if hidden * length > tolerance:
        words += f"; a scale wrong by {100 * hidden:.2g} %, {hidden * length:.2g} {unit} over the part, would not show"
    return words


def _describe_scale(fit: ModelFit, unit: str) -> str:
    percent = 100 * (fit.scale - 1)
    larger = "larger" if percent > 0 else "smaller"
    return (
        f"wrong scale: the scan is {abs(percent):.3g} % {larger} than the part (standard error "
        f"{100 * fit.scale_error:.2g} %), up to {fit.amount:.3g} {unit} at its ends; check unit, temperature and scale "
        "bar, or correct it by scan: {scale: auto}"
    )


def _describe_deformation(fit: ModelFit, unit: str) -> str:
    kinds = " and ".join(f"{DONE[kind]} by {amount:.3g} {unit}" for kind, amount in fit.deformation)
    return (
        f"the part is {kinds}: the seen skin deviates by up to {fit.amount:.3g} {unit} (standard error "
        f"{fit.amount_error:.2g}) from the nearest rigid part"
    )


def _describe_views(fit: ModelFit, unit: str) -> str:
    apart = max((view.apart for view in fit.views), default=0.0)
    moved = [_describe_view(view, unit) for view in fit.views if view.is_corrected]
    left = [_describe_view(view, unit) for view in fit.views if view.is_elsewhere and not view.is_corrected]
    open_ = [str(view.number + 1) for view in fit.views if not view.is_determined and view.left > 0.5 * apart]
    words = f"views disagree by {apart:.3g} {unit} where they overlap"
    words += {
        "given": "",
        "order": f" ({len(fit.views)} views, by the order of the points)",
        "sheets": " (two views, by two surfaces over the same skin)",
    }[fit.views_from]
    if moved:
        words += "; corrected: " + ", ".join(moved)
    if left:
        words += "; misplaced, not corrected: " + ", ".join(left)
    if open_:
        words += f"; not corrected, since their pose is not fixed: view {', '.join(open_)}"
    if fit.views_hidden:
        words += f"; {fit.views_hidden:.3g} {unit}³ of the correction may be wear, on skin of one view alone"
    return words


def _describe_view(view: ViewFit, unit: str) -> str:
    return f"view {view.number + 1} by {np.linalg.norm(view.shift):.3g} {unit} and {view.turn:.2g} degrees" + (
        f" ({view.held} of six motions held)" if view.held else ""
    )

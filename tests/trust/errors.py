"""Errors of sites with known terms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from damageest.trust.interval.scanner import Figure
from damageest.trust.interval.site_error import Share, SiteError, Term
from damageest.trust.terms import list_terms

TERMS: dict[str, Term] = {cls.name: cls() for cls in list_terms()}
FIGURES = {
    "probing_form": Figure("probing_form", 0.004, "mm", 1.0, "normal"),
    "probing_size": Figure("probing_size", 0.01, "mm", 0.5, "normal"),
    "length": Figure("length", 2e-4, "", 1.0, "rectangular"),
}
BOUNDS = {
    "inside": ("inside", "high"),
    "beside": ("beside", "high"),
    "fading": ("fading", "high"),
    "less": ("closed", "low"),
}
"""What moves one end: the term, and which."""
SOURCES = {"noise": 0.02, "tessellation": 0.01 / 3**0.5}


def make_error(volume: float, **named: Any) -> SiteError:
    """Names of terms give what they make of the volume, ``scanner`` (2,) what size and length error do, others what
    `SiteError` has."""
    return change(SiteError(volume), **named)


def change(error: SiteError, **named: Any) -> SiteError:
    """The error with other terms or fields."""
    shares = {term.name: share for term, share in error.shares}
    if "scanner" in named:
        named |= dict(zip(("probing_size", "length"), named.pop("scanner"), strict=True))
    for name in [name for name in named if name in BOUNDS]:
        term, end = BOUNDS[name]
        shares[term] = Share(**{end: named.pop(name)})
    for name in [name for name in named if name in TERMS]:
        shares[name] = Share(named.pop(name), 0.0, SOURCES.get(name, 0.0), FIGURES.get(name))
    return replace(error, shares=tuple((TERMS[name], shares[name]) for name in TERMS if name in shares), **named)


def take(error: SiteError, name: str) -> Any:
    """What a term makes of the volume, (J,), or a field of the error."""
    if name in BOUNDS:
        of, end = BOUNDS[name]
        return sum(getattr(share, end) for term, share in error.shares if term.name == of)
    found = [share.columns for term, share in error.shares if term.name == name]
    if name in TERMS:
        return found[0] if found else np.zeros(1)
    return getattr(error, name)

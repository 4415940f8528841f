"""The causes that make the interval of the volume wide."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts
from damageest.trust.interval.site_error import Term
from damageest.trust.terms import list_terms

TOLD = 0.05
"""Half-width of the interval, as a share of the volume, from which its causes are told."""
LARGE = 1 / 3
"""Half-width that a cause gives by itself, as a share of the largest one, from which it is named."""


class WideInterval(Rule):
    code = "wide_interval"
    meaning = "quantifiable errors make the interval wide; result.json has each under uncertainty"
    threshold = f"a half-width of {TOLD:.0%} of the volume; causes of a third of the largest one are named"
    remedy = "that of the largest cause, which the reason names"
    topic = "doubtful"
    rank = 260

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.uncertainty is None or site.interval is None:
            return
        if site.interval[1] - site.interval[0] <= 2 * TOLD * site.volume:
            return
        terms = {one.name: one for one in site.terms or [term() for term in list_terms()] if one.words}
        halves = {name: 2 * site.uncertainty.measure(name) for name in terms}
        most = max(halves.values())
        told = sorted((name for name in halves if halves[name] > LARGE * most), key=lambda name: -halves[name])
        if not told:  # what makes it wide is told by other rules: free motions, what is not seen
            return
        words = [f"±{halves[name]:.3g} {scan.unit}³ ({self._name(terms[name], scan)})" for name in told]
        text = f"its volume is uncertain by {', '.join(words)}"
        yield Reason(self.code, text, "widens", halves[told[0]], f"{scan.unit}³", remedy=terms[told[0]].remedy)

    def _name(self, term: Term, scan: ScanFacts) -> str:
        if term.name == "form" and scan.fit is not None and scan.fit.model != "ok":
            return f"{term.words}: {scan.fit.name}"
        return term.words

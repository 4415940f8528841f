"""The causes that make the interval of the volume wide."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

TOLD = 0.05
"""Half-width of the interval, as a share of the volume, from which its causes are told."""
LARGE = 1 / 3
"""Half-width that a cause gives by itself, as a share of the largest one, from which it is named."""
CAUSES = {
    "form": ("deviating intact skin", "check whether the part is bent, or the scan scaled"),
    "outward": ("skin as far outside the part", "check pose and scale of the scan"),
    "views": ("disagreeing views", "register the views again"),
    "adapt": (
        "adaptation of the part",
        "scan more intact skin beside it, or give a datum or a second part of its type",
    ),
    "pose": ("pose", "scan more intact skin, or name unworn faces in align.datum"),
    "rim": ("rim", "a smaller tolerance, if the noise allows it"),
    "spacing": ("gaps between the points", "scan this place more densely"),
    "noise": ("noise", "scan with less noise, or several times"),
    "tessellation": (
        "triangles of part or earlier scan",
        "a finer part.chord, or a denser earlier scan",
    ),
}
"""Each cause in words, and what makes it smaller."""


class Terms(Rule):
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
        halves = {name: 2 * float(getattr(site.uncertainty, name)) for name in CAUSES}
        most = max(halves.values())
        told = sorted((name for name in halves if halves[name] > LARGE * most), key=lambda name: -halves[name])
        if not told:  # what makes it wide is told by other rules: free motions, what is not seen
            return
        words = [f"±{halves[name]:.3g} {scan.unit}³ ({self._name(name, scan)})" for name in told]
        text = f"its volume is uncertain by {', '.join(words)}"
        yield Reason(self.code, text, "widens", halves[told[0]], f"{scan.unit}³", remedy=CAUSES[told[0]][1])

    def _name(self, cause: str, scan: ScanFacts) -> str:
        words = CAUSES[cause][0]
        if cause == "form" and scan.fit is not None and scan.fit.model != "ok":
            return f"{words}: {scan.fit.name}"
        return words

"""Notes on a whole run: their codes, their order, and how many of one code are joined into one line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damageest.artefacts import Reason

if TYPE_CHECKING:
    from damageest.result import Result


@dataclass(frozen=True)
class RunCode:
    """``meaning`` of a code; ``rank``: 0 may change a decision about the part, 1 one about the scan, 2 reports an
    action. ``plural``: the name of many of them in one line; empty where each has its own line."""

    meaning: str
    rank: int
    plural: str = ""


RUN_CODES: dict[str, RunCode] = {
    "displaced_piece": RunCode("metal outside may be a displaced piece of the part", 0, "displaced pieces"),
    "model_fit": RunCode("the part as designed does not explain the intact skin: bent, scaled, wavy, views apart", 0),
    "align": RunCode("the stage align about the pose: symmetry, free motions, doubts", 0),
    "datum_moved": RunCode("an adapted part or corrected views moved the pose of the datums", 0),
    "unit": RunCode("the unit of part or scan is doubtful", 0),
    "columns": RunCode("the part's size decided the columns of a text file", 0),
    "thin_walls": RunCode("the tolerance exceeds half the wall thickness: no damage is found there", 0),
    "tolerance_small": RunCode("small tolerance: intact skin may look damaged", 0),
    "tolerance_raised": RunCode("tolerance: auto was raised: intact skin deviates by more than the noise", 0),
    "earlier_scan": RunCode("the part is an earlier scan: only common skin is compared", 0),
    "table_aside": RunCode("a table in both scans was set aside: it did not move with the part", 0),
    "few_points": RunCode("very few scan points", 0),
    "fell_back": RunCode("method auto took surface, since implicit failed", 1),
    "below_noise": RunCode("shallow places treated as errors of the scan", 0),
    "certificate": RunCode("the scan contradicts certificate or temperature", 1),
    "depth_steps": RunCode("the scan's depth has steps, like that of a depth camera", 1),
    "coarse_numbers": RunCode("too few digits in the file for a scan so far from the origin", 1),
    "sparse_scan": RunCode("sparse points for the tolerance", 1),
    "coarse_part": RunCode("the part's triangles deviate from its CAD surface by more than half the tolerance", 1),
    "surroundings": RunCode("points of surroundings were removed", 1),
    "filled_points": RunCode("points of filled holes were removed", 1),
    "far_points": RunCode("points far from all others were removed", 1),
    "low_confidence": RunCode("points of a confidence below `min_confidence` were removed", 1),
    "files_not_read": RunCode("files of a folder in unknown formats", 1),
    "surplus": RunCode("points outside the skin could not be grouped", 1),
    "speck": RunCode("a few damaged points without a volume were left out", 1, "groups of a few damaged points"),
    "segment": RunCode("the stage segment about its limits", 2),
    "scraps": RunCode("fragments without scan points were dropped", 2),
    "site_dropped": RunCode("a site was dropped, as the job says", 2),
    "sites_merged": RunCode("sites were merged, as the job says", 2),
    "cluster": RunCode("the stage cluster about its groups of points", 2),
    "section": RunCode("missing parts or values of a section", 1),
    "renamed": RunCode("the job has an option by its former name", 2),
    "export": RunCode("a file was written differently from the job, or not at all", 1),
    "report": RunCode("the report failed; the run continued", 1),
}
"""Codes of the notes of a run. Those of sites are the codes of rules, or of the stage that gave a note."""
MOST_PRINTED = 8
"""Lines of notes that a run prints, those first that change a decision; result.json and report.html have all."""
DECIDES = ("contradicts", "open")
"""Effects of reasons that change what a site is taken for."""
FOLDED = 3
"""Notes of one code from which they become one line."""


def make_notes(stage: str, notes: Iterable[str]) -> tuple[Reason, ...]:
    """The notes of a stage as reasons, with the stage as their code."""
    return tuple(Reason(stage, note) for note in notes)


def rank_notes(notes: Iterable[Reason]) -> tuple[Reason, ...]:
    """The notes without repetitions, those first that change a decision; those of equal rank in their order."""
    last = RunCode("", 2)
    return tuple(sorted(dict.fromkeys(notes), key=lambda note: RUN_CODES.get(note.code, last).rank))


def merge_notes(notes: Sequence[Reason]) -> tuple[Reason, ...]:
    """The notes with many of one code as one line, which gives their number and the sum of their amounts."""
    folded: list[Reason] = []
    done: set[str] = set()
    for note in notes:
        alike = [other for other in notes if other.code == note.code]
        plural = RUN_CODES[note.code].plural if note.code in RUN_CODES else ""
        if not plural or len(alike) < FOLDED:
            folded.append(note)
        elif note.code not in done:
            done.add(note.code)
            folded.append(
                replace(note, text=f"{len(alike)} {plural}: {RUN_CODES[note.code].meaning}", amount=len(alike))
            )
    return tuple(folded)


@dataclass(frozen=True)
class SiteReason:
    """One reason, and the numbers of the ``sites`` that have it in the same words."""

    sites: tuple[int, ...]
    reason: Reason

    @property
    def names(self) -> str:
        return f"site {self.sites[0]}" if len(self.sites) == 1 else f"sites {', '.join(map(str, self.sites))}"


def join_reasons(reasons: Iterable[tuple[int, Reason]]) -> tuple[SiteReason, ...]:
    """Reasons of sites, each one once with all sites that have it."""
    found: dict[Reason, list[int]] = {}
    for number, reason in reasons:
        found.setdefault(reason, []).append(number)
    return tuple(SiteReason(tuple(numbers), reason) for reason, numbers in found.items())


def list_notes(result: Result) -> list[str]:
    """The notes on the run and on its sites, in the order in which a run prints them: those first that change a
    decision, each reason once, with the sites that have it."""
    ranks = {code: one.rank for code, one in RUN_CODES.items()}
    notes = [(ranks.get(note.code, 2), str(note)) for note in merge_notes(result.warnings)]
    for level in ("doubtful", "likely", "proven"):
        chosen = [site for site in result.sites if site.verdict.level == level]
        told = [(site.id, reason) for site in chosen for reason in site.verdict.reasons]
        for one in _merge_alike(join_reasons(told)):
            verb, decides = ("is" if len(one.sites) == 1 else "are"), level != "proven" and one.reason.effect in DECIDES
            notes.append((0 if decides else 1, f"{one.names} {verb} {level}: {one.reason}"))
    told = [(site.id, note) for site in result.sites for note in site.warnings]
    notes += [(2, f"{one.names}: {one.reason}") for one in join_reasons(told)]
    return [text for _, text in sorted(notes, key=lambda note: note[0])]


def _merge_alike(reasons: Sequence[SiteReason]) -> tuple[SiteReason, ...]:
    """The reasons, with those of one code that many sites have in different words as one: the words of the first."""
    folded: dict[str, SiteReason] = {}
    many = {one.reason.code for one in reasons if sum(o.reason.code == one.reason.code for o in reasons) >= FOLDED}
    for one in reasons:
        key = one.reason.code if one.reason.code in many else f"{one.sites} {one.reason}"
        before = folded.get(key)
        if before is None:
            folded[key] = one
        else:
            sites = tuple(sorted({*before.sites, *one.sites}))
            folded[key] = SiteReason(sites, before.reason)
    return tuple(folded.values())


def cap_notes(notes: Sequence[str]) -> list[str]:
    """At most `MOST_PRINTED` lines: the first notes, and the number of the others."""
    if len(notes) <= MOST_PRINTED:
        return list(notes)
    more = len(notes) - MOST_PRINTED + 1
    return [*notes[: MOST_PRINTED - 1], f"{more} more notes are in result.json and report.html"]


def qualify_nothing(notes: Iterable[Reason]) -> str:
    """The qualification of "no damage was found" where places count as errors of the scan; else empty."""
    return " that errors of the scan do not explain" if any(note.code == "below_noise" for note in notes) else ""

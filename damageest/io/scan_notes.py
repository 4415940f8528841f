"""What is said about the unit and the confidence of the points of scan files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from damageest.artefacts import Flags, Floats, Reason, Singles
from damageest.errors import InputError
from damageest.geometry.units import FULL_NAMES, canonical_unit
from damageest.io.points.attributes import CONFIDENCE


class UnitNotes:
    """Decides the unit of each file: ``source``, which the job gives for all; else its own; else ``unit``."""

    def __init__(self, source: str | None, unit: str) -> None:
        self._source = canonical_unit(source) if source else None
        self._unit = canonical_unit(unit)
        self._notes: dict[str, dict[str, None]] = {}
        self._warnings: dict[tuple[str, str], dict[str, None]] = {}

    def settle(self, path: Path, own: str | None, said: str) -> str:
        """The unit of a file. ``own``: that it states, None where it states none; ``said``: the line of its header that
        states it, empty where it is that of the format."""
        stated = canonical_unit(own) if own else None
        chosen = self._source or stated or self._unit
        by = f"its header says '{said}'" if said else f"{path.suffix.lower()} files have {FULL_NAMES[stated or chosen]}"
        if self._source and stated and stated != self._source:
            text = f"the unit of the job is used, scan.unit: {self._source}, although {by}"
            self._add_warning(path, text, "remove scan.unit if the file is right")
        elif stated and said and not self._source and stated != self._unit:
            text = f"the lengths are taken as {FULL_NAMES[stated]}, since {by}, not as {FULL_NAMES[self._unit]}"
            self._add_warning(path, text, f"give scan.unit: {self._unit} if the header is wrong")
        elif stated and said:
            self._notes.setdefault(f"the lengths are {FULL_NAMES[stated]}: {by}", {})[path.name] = None
        if chosen != self._unit:
            self._notes.setdefault(f"converted from {chosen} to {self._unit}", {})[path.name] = None
        return chosen

    def _add_warning(self, path: Path, text: str, remedy: str) -> None:
        self._warnings.setdefault((text, remedy), {})[path.name] = None

    def notes(self) -> tuple[str, ...]:
        """What was decided, each with the files that it holds for."""
        return tuple(f"{_list_names(list(names))}: {text}" for text, names in self._notes.items())

    def warnings(self) -> tuple[Reason, ...]:
        """Where a file and the job differ."""
        return tuple(
            Reason("unit", f"{_list_names(list(names))}: {text}", remedy=remedy)
            for (text, remedy), names in self._warnings.items()
        )


class ConfidenceCount:
    """Sets points of a confidence below ``least`` aside, none where it is None, and counts them."""

    def __init__(self, least: float | None) -> None:
        self._least = None if least is None else np.float32(least)
        self._with = self._without = self._low = 0
        self._from, self._to = np.inf, -np.inf

    def choose(self, confidence: Singles | None, count: int) -> Flags | None:
        """Whether each point (N,) is kept; None for all. Points without a number are set aside."""
        if confidence is None:
            self._without += count
            return None
        self._with += count
        finite = confidence[np.isfinite(confidence)]
        self._from = min(self._from, float(finite.min(initial=np.inf)))
        self._to = max(self._to, float(finite.max(initial=-np.inf)))
        if self._least is None:
            return None
        kept = np.asarray(confidence >= self._least)
        self._low += int((~kept).sum())
        return kept

    def require(self, paths: Sequence[Path]) -> None:
        """Raises InputError where points should be set aside, and none has a confidence, or no point is left."""
        if self._least is None:
            return
        names = _list_names([path.name for path in paths])
        if not self._with and self._without:
            raise InputError(
                f"scan: min_confidence: {names}: no point has a confidence, which is a property or column of the name "
                f"{', '.join(CONFIDENCE)}; export it, or remove min_confidence"
            )
        if self._low == self._with and not self._without:
            raise InputError(
                f"scan: min_confidence: {names}: no point has a confidence of {self._least:g} or more; it is "
                f"{self._from:g} to {self._to:g}"
            )

    def notes(self) -> tuple[str, ...]:
        """That nothing was set aside where the points have a confidence."""
        if not self._with or self._least is not None or not self._from < self._to:
            return ()
        return (
            f"{self._with} points have a confidence, {self._from:g} to {self._to:g}; none is set aside by it; "
            "scan.min_confidence sets aside those below a value",
        )

    def warnings(self) -> tuple[Reason, ...]:
        """How many points were set aside."""
        if self._least is None:
            return ()
        text = (
            f"{self._low} of {self._with} scan points were removed: confidence below {self._least:g} (min_confidence)"
        )
        if self._without:
            text += f"; {self._without} points without confidence are used"
        return (Reason("low_confidence", text, amount=self._low, remedy="lower min_confidence if skin is missing"),)


COARSE = 20_000
"""Steps across a scan below which its numbers are said to be coarse: a noise of 1/5000 of the size is one of four."""


def describe_coarse(points: Floats, path: Path) -> Reason | None:
    """A warning where the coordinates (N,3) of a file are in single precision and so far from the origin that they have
    steps; None for others."""
    known = points[np.isfinite(points).all(axis=1)]
    if not len(known) or np.abs(known).max() > np.finfo(np.float32).max:
        return None
    far, size = np.abs(known).max(axis=0), float(np.ptp(known, axis=0).max())
    step = float(np.spacing(far.astype(np.float32)).max())
    if not 0 < size < COARSE * step or not np.array_equal(known, known.astype(np.float32)):
        return None
    text = (
        f"{path.name}: single precision so far from the origin ({far.max():.4g}) gives steps of {step:.2g}, "
        f"{size / step:.0f} steps across the scan"
    )
    return Reason("coarse_numbers", text, amount=step, remedy="move the scan near the origin, then export it")


def _list_names(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"

"""What the command line asks to be varied, as the variants of a case."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from damageest.checks.scan_quality import AUTO_TOLERANCE
from damageest.errors import InputError
from damageest.geometry.units import unit_factor
from damageest.job.yamlfile import parse

SHORT = {"tolerance": "--tolerance", "scan.noise": "--noise", "scan.points": "--points"}
OWN = ("part", "scan", "scan.use", "scan.damage", "scan.seed")
"""What cannot be varied: the evaluation sees to it."""

Label = float | str
Axes = dict[str, list[tuple[Label | None, Any]]]
"""What is varied to its values: the label, None for none, and what it does."""


@dataclass(frozen=True)
class Wanted:
    """The options as written; empty: as it is. ``size`` may be ``any``; lengths carry a unit, or ``x`` for times. Each
    of ``against`` is settings with spaces between: a way to compare with what the job or the defaults say."""

    size: str = ""
    noise: str = ""
    points: str = ""
    tolerance: str = ""
    vary: Sequence[str] = ()
    settings: Sequence[str] = ()
    against: Sequence[str] = ()


@dataclass(frozen=True)
class Base:
    """What a part and its scanner are without variation. ``tolerance``: its length; ``auto``: it follows the noise.

    ``relative``: labels and bare tolerances are multiples, noise of this noise, tolerance of the noise, as for several
    parts of different size. ``uses``: the implementations that the job names, by stage.
    """

    unit: str
    scanner: Mapping[str, Any]
    tolerance: float
    auto: bool
    relative: bool
    uses: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Variant:
    """One combination. ``tolerance``: the length to expect."""

    varied: Mapping[str, Label]
    size: float | None
    scanner: Mapping[str, Any]
    settings: tuple[str, ...]
    tolerance: float


def variants(wanted: Wanted, base: Base) -> list[Variant]:
    """All combinations, sizes first. Raises InputError for what cannot be read or varied."""
    axes: Axes = {}
    axes["size"] = [] if wanted.size == "any" else _lengths("--size", wanted.size, base.unit, base.tolerance, False)
    axes["size"] = axes["size"] or [(None, None)]
    noise = _lengths("--noise", wanted.noise, base.unit, float(base.scanner["noise"]), True)
    axes["noise"] = noise or [(None, None)]
    axes["points"] = [(n, n) for n in _counts(wanted.points)] or [(None, None)]
    axes["tolerance"] = _tolerances(wanted.tolerance, base) or [(None, "auto" if base.auto else base.tolerance)]
    axes["way"] = [("default", ()), *((text, tuple(text.split())) for text in dict.fromkeys(wanted.against))]
    for text in wanted.vary:
        name, values = _option(text, base)
        if name in axes:
            raise InputError(f"--vary {text}: '{name}' is varied already; give all its values at once, as a,b,c")
        axes[name] = values
    return [_variant(dict(zip(axes, choice, strict=True)), axes, wanted, base) for choice in product(*axes.values())]


def _variant(chosen: Mapping[str, tuple[Label | None, Any]], axes: Axes, wanted: Wanted, base: Base) -> Variant:
    scanner = dict(base.scanner)
    for name in ("noise", "points"):
        scanner[name] = chosen[name][1] if chosen[name][1] is not None else scanner[name]
    tolerance = chosen["tolerance"][1]
    if isinstance(tolerance, tuple):  # of the noise
        tolerance = tolerance[0] * scanner["noise"]
    settings = [*wanted.settings, f"tolerance={json.dumps(tolerance)}"]
    for name, (_, value) in chosen.items():
        if name.startswith("scan."):
            scanner[name.removeprefix("scan.")] = value
        elif name == "way":
            settings += value
        elif name not in ("size", "noise", "points", "tolerance") and value is not None:
            settings.append(value)
    expected = AUTO_TOLERANCE * scanner["noise"] if tolerance == "auto" else float(tolerance)
    varied = {name: label for name, (label, _) in chosen.items() if len(axes[name]) > 1 and label is not None}
    if base.relative and "noise" in varied:
        varied["noise"] = float(f"{scanner['noise'] / base.scanner['noise']:.6g}")
    return Variant(varied, chosen["size"][1], scanner, tuple(settings), expected)


def _lengths(option: str, text: str, unit: str, base: float, times: bool) -> list[tuple[Label | None, Any]]:
    """(label, length) of each; ``times``: a bare number is a multiple of ``base`` rather than a length."""
    found: list[tuple[Label | None, Any]] = []
    for word in filter(None, (word.strip() for word in text.split(","))):
        match = re.fullmatch(r"(\d*\.?\d+(?:[eE][+-]?\d+)?)\s*(\D*)", word)
        if not match:
            raise InputError(f"{option}: '{word}' is no length; give numbers with commas between, as 0.5,2x,0.1mm")
        number, suffix = float(match[1]), match[2]
        if suffix == "x" or (times and not suffix):
            if number and not base:
                raise InputError(f"{option}: '{word}' is a multiple of 0; give lengths, as 0.01{unit}")
            number *= base
        elif suffix:
            number *= unit_factor(suffix, unit)
        number = float(f"{number:.6g}")
        found.append((number, number))
    return list(dict.fromkeys(found))


def _tolerances(text: str, base: Base) -> list[tuple[Label | None, Any]]:
    found: list[tuple[Label | None, Any]] = []
    for word in filter(None, (word.strip() for word in text.split(","))):
        if word == "auto":
            found.append((word, word))
            continue
        # of several parts, a bare number is a multiple of each one's noise
        if base.relative and re.fullmatch(r"[\d.]+", word):
            found.append((float(word), (float(word),)))
        else:
            found += _lengths("--tolerance", word, base.unit, base.tolerance, False)
        if not found[-1][0]:
            raise InputError(f"--tolerance: {word}: has to be above 0, or auto")
    return found


def _counts(text: str) -> list[int]:
    try:
        found = list(dict.fromkeys(int(float(word)) for word in text.split(",") if word.strip()))
    except ValueError:
        found = [0]
    if any(count < 1 for count in found):
        raise InputError(f"--points: '{text}': give numbers of points with commas between, as 20000,150000")
    return found


def _option(text: str, base: Base) -> tuple[str, list[tuple[Label | None, Any]]]:
    """The option that ``stage.option=a,b,c`` names, and its values with what they do."""
    name, equals, given = text.partition("=")
    name = name.strip()
    values, _ = parse(f"[{given}]", f"--vary {name}")
    if not equals or not values:
        raise InputError(f"--vary takes stage.option=a,b,c, stage=a,b,c or method=a,b,c; not '{text}'")
    if name in SHORT:
        raise InputError(f"--vary {name}: there is an option of its own for this: {SHORT[name]} {given}")
    if name in OWN or name.startswith("part."):
        raise InputError(f"--vary {name}: cannot be varied, since the evaluation makes the damages and the scans")
    labels: list[Label] = [v if isinstance(v, (int, float)) else v if isinstance(v, str) else str(v) for v in values]
    if name.startswith("scan."):
        return name, list(zip(labels, values, strict=True))
    stage = name.removesuffix(".use")
    if stage != name:
        # another implementation has other options: those that the job gives stay with its own one
        uses = [None if value == base.uses.get(stage) else f"{stage}={json.dumps(value)}" for value in values]
        return stage, list(zip(labels, uses, strict=True))
    return name, [(label, f"{name}={json.dumps(value)}") for label, value in zip(labels, values, strict=True)]

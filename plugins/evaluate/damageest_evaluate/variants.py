"""The values that the command line asks to vary, and their combinations."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from damageest.errors import InputError
from damageest.geometry.noise import AUTO_TOLERANCE
from damageest.geometry.units import unit_factor
from damageest.job.yamlfile import parse

OWN_OPTIONS = {"tolerance": "--tolerance", "scan.noise": "--noise", "scan.points": "--points"}
"""Names that have a command line option of their own."""
FIXED = ("part", "scan", "scan.use", "scan.damage", "scan.seed")
"""Options that cannot be varied, because the evaluation sets them."""

Label = float | str
Axes = dict[str, list[tuple[Label | None, Any]]]
"""Name of what is varied: for each value its label in tables (None: not listed), and the value or setting."""


@dataclass(frozen=True)
class VariationRequest:
    """The options of the command line as text; empty: not varied.

    ``size`` may be ``any``. Lengths may have a unit, or ``x`` for a multiple. Each of ``against`` holds settings with
    spaces between them, to compare with the job or the defaults.
    """

    size: str = ""
    noise: str = ""
    points: str = ""
    tolerance: str = ""
    vary: Sequence[str] = ()
    settings: Sequence[str] = ()
    against: Sequence[str] = ()


@dataclass(frozen=True)
class Baseline:
    """A part and its scanner without variation.

    ``tolerance``: its length; ``auto``: the job's tolerance is auto and follows the noise. ``relative``: for several
    parts of different size; labels of noise are multiples of this noise, and tolerances without a unit are multiples
    of the noise. ``uses``: name of the job's implementation, by stage.
    """

    unit: str
    scanner: Mapping[str, Any]
    tolerance: float
    auto: bool
    relative: bool
    uses: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Variant:
    """One combination of values. ``tolerance``: the tolerance that the run is expected to use."""

    varied: Mapping[str, Label]
    size: float | None
    scanner: Mapping[str, Any]
    settings: tuple[str, ...]
    tolerance: float


def make_variants(request: VariationRequest, base: Baseline) -> list[Variant]:
    """All combinations; the size varies slowest. Raises InputError for a value or an option that is not valid."""
    axes: Axes = {}
    axes["size"] = (
        [] if request.size == "any" else _parse_lengths("--size", request.size, base.unit, base.tolerance, False)
    )
    axes["size"] = axes["size"] or [(None, None)]
    noise = _parse_lengths("--noise", request.noise, base.unit, float(base.scanner["noise"]), True)
    axes["noise"] = noise or [(None, None)]
    axes["points"] = [(n, n) for n in _parse_counts(request.points)] or [(None, None)]
    axes["tolerance"] = _parse_tolerances(request.tolerance, base) or [(None, "auto" if base.auto else base.tolerance)]
    axes["way"] = [("default", ()), *((text, tuple(text.split())) for text in dict.fromkeys(request.against))]
    for text in request.vary:
        name, values = _parse_option(text, base)
        if name in axes:
            raise InputError(
                f"--vary {text}: '{name}' is given twice; give all its values in one option, for example {name}=a,b,c"
            )
        axes[name] = values
    return [
        _make_variant(dict(zip(axes, choice, strict=True)), axes, request, base) for choice in product(*axes.values())
    ]


def _make_variant(
    chosen: Mapping[str, tuple[Label | None, Any]], axes: Axes, request: VariationRequest, base: Baseline
) -> Variant:
    scanner = dict(base.scanner)
    for name in ("noise", "points"):
        scanner[name] = chosen[name][1] if chosen[name][1] is not None else scanner[name]
    tolerance = chosen["tolerance"][1]
    if isinstance(tolerance, tuple):  # a multiple of the noise
        tolerance = tolerance[0] * scanner["noise"]
    settings = [*request.settings, f"tolerance={json.dumps(tolerance)}"]
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


def _parse_lengths(option: str, text: str, unit: str, base: float, times: bool) -> list[tuple[Label | None, Any]]:
    """(label, length) of each value. ``times``: a number without a unit is a multiple of ``base``, not a length."""
    values: list[tuple[Label | None, Any]] = []
    for word in filter(None, (word.strip() for word in text.split(","))):
        match = re.fullmatch(r"(\d*\.?\d+(?:[eE][+-]?\d+)?)\s*(\D*)", word)
        if not match:
            raise InputError(
                f"{option}: '{word}' is not a length; give numbers separated by commas, for example 0.5,2x,0.1mm"
            )
        number, suffix = float(match[1]), match[2]
        if suffix == "x" or (times and not suffix):
            if number and not base:
                raise InputError(
                    f"{option}: '{word}' is a multiple of 0; give a length with its unit, for example 0.01{unit}"
                )
            number *= base
        elif suffix:
            number *= unit_factor(suffix, unit)
        number = float(f"{number:.6g}")
        values.append((number, number))
    return list(dict.fromkeys(values))


def _parse_tolerances(text: str, base: Baseline) -> list[tuple[Label | None, Any]]:
    values: list[tuple[Label | None, Any]] = []
    for word in filter(None, (word.strip() for word in text.split(","))):
        if word == "auto":
            values.append((word, word))
            continue
        # for several parts, a number without a unit is a multiple of the noise of each part
        if base.relative and re.fullmatch(r"[\d.]+", word):
            values.append((float(word), (float(word),)))
        else:
            values += _parse_lengths("--tolerance", word, base.unit, base.tolerance, False)
        if not values[-1][0]:
            raise InputError(f"--tolerance: '{word}' is not above 0; give a length above 0, or auto")
    return values


def _parse_counts(text: str) -> list[int]:
    try:
        values = list(dict.fromkeys(int(float(word)) for word in text.split(",") if word.strip()))
    except ValueError:
        values = [0]
    if any(count < 1 for count in values):
        raise InputError(
            f"--points: '{text}' is not valid; give numbers of points separated by commas, for example 20000,150000"
        )
    return values


def _parse_option(text: str, base: Baseline) -> tuple[str, list[tuple[Label | None, Any]]]:
    """The name of the option in ``stage.option=a,b,c``, and for each value its label and its setting."""
    name, equals, given = text.partition("=")
    name = name.strip()
    values, _ = parse(f"[{given}]", f"--vary {name}")
    if not equals or not values:
        raise InputError(f"--vary {text}: not valid; give stage.option=a,b,c, stage=a,b,c or method=a,b,c")
    if name in OWN_OPTIONS:
        raise InputError(f"--vary {name}: not valid; use the option {OWN_OPTIONS[name]} {given}")
    if name in FIXED or name.startswith("part."):
        raise InputError(f"--vary {name}: cannot be varied, because the evaluation makes the damages and the scans")
    labels: list[Label] = [v if isinstance(v, (int, float)) else v if isinstance(v, str) else str(v) for v in values]
    if name.startswith("scan."):
        return name, list(zip(labels, values, strict=True))
    stage = name.removesuffix(".use")
    if stage != name:
        # the job's options belong to its own implementation, and do not apply to another one
        uses = [None if value == base.uses.get(stage) else f"{stage}={json.dumps(value)}" for value in values]
        return stage, list(zip(labels, uses, strict=True))
    return name, [(label, f"{name}={json.dumps(value)}") for label, value in zip(labels, values, strict=True)]

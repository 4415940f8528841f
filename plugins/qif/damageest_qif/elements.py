"""Elements of a QIF document: their numbers, and values as the schema wants them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np

Element = ElementTree.Element

NAMESPACE = "http://qifstandards.org/xsd/qif3"


@dataclass
class Numbers:
    """Numbers of elements, from 1; ``last`` is the largest one given."""

    last: int = 0

    def take(self) -> str:
        self.last += 1
        return str(self.last)


@dataclass
class Lists:
    """The lists of a document that sites and datums add to."""

    numbers: Numbers = field(default_factory=Numbers)
    datums: list[Element] = field(default_factory=list)
    frames: list[Element] = field(default_factory=list)
    entities: dict[int, Element] = field(default_factory=dict)
    feature_definitions: list[Element] = field(default_factory=list)
    feature_nominals: list[Element] = field(default_factory=list)
    feature_items: list[Element] = field(default_factory=list)
    feature_measurements: list[Element] = field(default_factory=list)
    point_sets: list[Element] = field(default_factory=list)
    definitions: list[Element] = field(default_factory=list)
    nominals: list[Element] = field(default_factory=list)
    items: list[Element] = field(default_factory=list)
    measurements: list[Element] = field(default_factory=list)


def make(name: str, /, *children: Element | None, text: str | None = None, **attributes: str) -> Element:
    """An element with children, those that are None left out."""
    found = Element(name, attributes)
    found.text = text
    found.extend([child for child in children if child is not None])
    return found


def make_list(name: str, children: Sequence[Element]) -> Element | None:
    """A list element with the number of its ``children``; None where there are none, as the schema wants it."""
    return make(name, *children, n=str(len(children))) if children else None


def refer(name: str, numbers: Iterable[str]) -> Element | None:
    """A list of references."""
    return make_list(name, [make("Id", text=number) for number in numbers])


def write_number(value: float) -> str:
    """A number as `xs:decimal` has it: without exponent, as short as reads back the same."""
    return np.format_float_positional(float(value) + 0.0, trim="-")


def write_numbers(values: Iterable[float]) -> str:
    return " ".join(map(write_number, values))


def attributes(texts: Sequence[tuple[str, str]] = (), numbers: Sequence[tuple[str, float]] = ()) -> Element | None:
    """What the standard has no element for, as named texts and numbers."""
    made = [make("AttributeStr", name=name, value=clean(value)) for name, value in texts]
    made += [make("AttributeD1", name=name, value=write_number(value)) for name, value in numbers if np.isfinite(value)]
    return make_list("Attributes", made)


def clean(text: str) -> str:
    """A text without the characters that XML cannot hold."""
    return "".join(one if one >= " " and one not in "￾￿" and not "\ud800" <= one <= "\udfff" else " " for one in text)

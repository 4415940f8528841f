"""The formula of a certificate for the error of length, as "0.02 + L/20000": read by a grammar, never run as code.

    sum     = product ( "+" product )*
    product = factor ( ( "*" | "/" | nothing ) factor )*
    factor  = number | "L"

A formula is a constant plus a share of the length L: L stands in each product once at most, and never below a line.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

LONGEST = 100
"""Characters of a formula."""
_TOKEN = re.compile(r"\s*(?:((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)|([Ll])|([+*/·×]))")


class LengthError(NamedTuple):
    """The error of a length L: ``constant`` + ``slope`` times L, none of them negative; in the unit of L."""

    constant: float
    slope: float

    def at(self, length: float) -> float:
        """The error of a length."""
        return self.constant + self.slope * length


def read_length_error(text: str | float) -> LengthError:
    """The error that a formula or a number says. Raises ValueError, with what is wrong and where."""
    if not isinstance(text, str):
        return _check(LengthError(float(text), 0.0), str(text))
    if len(text) > LONGEST:
        raise ValueError(f"a formula has at most {LONGEST} characters")
    tokens = _split(text)
    total, at = LengthError(0.0, 0.0), 0
    while True:
        product, at = _read_product(tokens, at, text)
        total = LengthError(total.constant + product.constant, total.slope + product.slope)
        if at == len(tokens):
            return _check(total, text)
        at += 1  # no other sign ends a product than "+"


def _split(text: str) -> list[str]:
    tokens, at, end = [], 0, len(text.rstrip())
    while at < end:
        found = _TOKEN.match(text, at)
        if found is None:
            rest = text[at:end].lstrip()
            advice = "; write decimals with a point" if rest.startswith(",") else ""
            raise ValueError(f"'{rest[:20]}' in '{text}' is no number, no L and none of + * /{advice}")
        tokens.append(found[1] or (found[2] or "").upper() or found[3].translate({ord("·"): "*", ord("×"): "*"}))
        at = found.end()
    return tokens


def _read_product(tokens: list[str], at: int, text: str) -> tuple[LengthError, int]:
    """The product that begins at a token, and where it ends."""
    value, power, sign = 1.0, 0, "*"
    while True:
        if at == len(tokens) or tokens[at] in "+*/":
            raise ValueError(f"'{text}': a number or L is missing after '{tokens[at - 1] if at else ''}'")
        token, at = tokens[at], at + 1
        if token == "L":
            power += 1 if sign == "*" else 2
        else:
            number = float(token)
            if sign == "/" and number == 0:
                raise ValueError(f"'{text}' divides by 0")
            value = value * number if sign == "*" else value / number
        if power > 1:
            raise ValueError(f"'{text}' is no constant plus a share of L, for example 0.02 + L/20000")
        if at == len(tokens) or tokens[at] == "+":
            return LengthError(0.0 if power else value, value if power else 0.0), at
        if tokens[at] not in "*/" and (tokens[at] != "L" or token == "L"):
            raise ValueError(f"'{text}': + * or / is missing between '{token}' and '{tokens[at]}'")
        sign = tokens[at] if tokens[at] in "*/" else "*"
        at += tokens[at] in "*/"


def _check(error: LengthError, text: str) -> LengthError:
    if not (math.isfinite(error.constant) and math.isfinite(error.slope)) or min(error) < 0:
        raise ValueError(f"'{text}' is not finite, or negative")
    return error

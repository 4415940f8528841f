"""The formula of a certificate: read as arithmetic would, whatever its spelling; all else is refused."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from damageest.job.length_error import LengthError, read_length_error

NUMBERS = st.floats(0.0, 1e6, allow_subnormal=False).map(lambda value: float(f"{value:.6g}"))
DIVISORS = st.floats(1e-3, 1e6).map(lambda value: float(f"{value:.6g}"))
SHARES = st.one_of(
    DIVISORS.map(lambda k: (f"L/{k!r}", 1 / k)),
    st.tuples(NUMBERS, DIVISORS).map(lambda pair: (f"{pair[0]!r} * L / {pair[1]!r}", pair[0] / pair[1])),
    NUMBERS.map(lambda k: (f"{k!r} L", k)),
    st.tuples(NUMBERS, DIVISORS).map(lambda pair: (f"l·{pair[0]!r}/{pair[1]!r}", pair[0] / pair[1])),
)


@given(NUMBERS, st.lists(SHARES, max_size=3), st.floats(0.0, 1e4))
def test_a_formula_gives_what_it_says(constant: float, shares: list[tuple[str, float]], length: float) -> None:
    found = read_length_error(" + ".join([repr(constant), *(text for text, _ in shares)]))
    assert found.at(length) == pytest.approx(constant + length * sum(share for _, share in shares), rel=1e-9)


@given(NUMBERS)
def test_a_number_is_a_constant_error(value: float) -> None:
    assert read_length_error(value) == read_length_error(repr(value)) == LengthError(value, 0.0)


@given(st.text(max_size=120))
def test_any_text_is_a_finite_error_or_refused(text: str) -> None:
    try:
        found = read_length_error(text)
    except ValueError:
        return
    assert math.isfinite(found.constant)
    assert math.isfinite(found.slope)
    assert min(found) >= 0
    assert set("".join(text.split())) <= set("0123456789.eE+-*/·×Ll")


@given(st.text("0123456789.eEL+*/ ", max_size=30))
def test_formulas_of_its_own_signs_are_read_or_refused(text: str) -> None:
    try:
        found = read_length_error(text)
    except ValueError:
        return
    spelled = text.replace(" ", "")
    assert spelled
    assert (found.slope > 0) <= ("L" in spelled)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "missing"), ("0.02 +", "missing"), ("L*L", "share of L"), ("20/L", "share of L"), ("L/0", "divides by 0"),
        ("0.02 - L/20000", "'-"), ("0,02 + L/300", "point"), ("__import__('os')", "no number"),
        ("0.02 0.03", "is missing"), ("L L", "is missing"),
        ("1e400", "finite"), ("1" * 101, "characters"), ("max(0.02, L)", "no number"),
    ],
)  # fmt: skip
def test_what_is_no_such_formula_is_refused_with_the_reason(text: str, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        read_length_error(text)

"""The fixed texts of page and PDF in the language of the job, from gettext's catalogues in ``locale/``.

The texts in the code are English. A language is a folder ``locale/<language>/LC_MESSAGES`` with ``damageest.po`` and
the ``damageest.mo`` made from it (``msgfmt``, or ``pybabel compile``).
"""

from __future__ import annotations

import gettext
import math
from pathlib import Path

N_ = str
"""Marks texts that are translated where they are shown."""
FOLDER = Path(__file__).parent / "locale"
ENGLISH = "en"
DECIMAL_MARK = "decimal mark: ."
"""Text of the catalogue whose last character is the decimal mark."""


def list_languages() -> list[str]:
    """The languages that there is a catalogue of, English first."""
    found = sorted(path.parent.parent.name for path in FOLDER.glob("*/LC_MESSAGES/damageest.mo"))
    return [ENGLISH, *found]


class Words:
    """Texts and numbers in a language of `list_languages`."""

    def __init__(self, language: str) -> None:
        other = language != ENGLISH
        self._catalogue = gettext.translation("damageest", FOLDER, [language]) if other else gettext.NullTranslations()
        self.language = language
        self._mark = self.tell(DECIMAL_MARK)[-1]

    def tell(self, text: str, **values: object) -> str:
        """A text of the catalogue with its ``values`` put in."""
        told = self._catalogue.gettext(text)
        return told.format(**values) if values else told

    def count(self, one: str, many: str, number: int) -> str:
        """A text for one or many of something, with ``number`` put in."""
        return self._catalogue.ngettext(one, many, number).format(number=number)

    def number(self, value: float | None, digits: int = 4) -> str:
        """A number with significant digits; a dash for none, and for what has no limit."""
        if value is None or not math.isfinite(value):
            return "–"
        if value == 0:
            return "0"
        size = math.floor(math.log10(abs(value)))
        return self.fixed(value, max(digits - 1 - size, 0))

    def fixed(self, value: float, decimals: int, plus: bool = False) -> str:
        """A number with decimals."""
        text = f"{abs(value):.{decimals}f}"
        sign = "−" if value < 0 and float(text) else "+" if plus else ""
        return sign + text.replace(".", self._mark)

    def share(self, value: float) -> str:
        """A share in percent; never 100 for less than all of it."""
        return "100 %" if value >= 1 else f"{self.fixed(min(100 * value, 99.9), 1)} %"


ENGLISH_WORDS = Words(ENGLISH)

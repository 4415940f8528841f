"""Cases on built-in parts."""

from __future__ import annotations

from damageest_evaluate.case import DamageCase

from damageest.artefacts import Part
from damageest_benchmarks.parts import PARTS, REFINED


class BuiltInCase(DamageCase):
    """A case on the built-in part of the name ``part``."""

    def load_part(self) -> Part:
        """The part."""
        return (PARTS | REFINED)[self.part]()

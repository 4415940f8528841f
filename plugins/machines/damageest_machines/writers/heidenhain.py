"""Heidenhain Klartext (iTNC 530, TNC 620, TNC 640).

Facts: HEIDENHAIN, "TNC 640 User's Manual, Klartext programming" (892903), chapters on multiple-axis machining: M128
keeps the tool's point while rotary axes turn, M129 ends it; LN blocks with NX NY NZ (normal) and TX TY TZ (tool axis),
vectors of length 1 with seven decimals; L blocks with positions of the rotary axes; M91 coordinates of the machine;
cycles 247 (preset), 32 (tolerance), 9 (dwell).
"""

from __future__ import annotations

from collections.abc import Sequence

from damageest.artefacts import Floats
from damageest_machines.post import CncPost, format_words


class Heidenhain(CncPost):
    """LN with vectors, or L with angles; with rotary axes by M128. The preset's number is that of frames.work."""

    suffix = "h"
    newline = "\r\n"

    def begin(self) -> list[str]:
        frames, blend = self.machine.frames, self.machine.post.blend
        lines = [f"BEGIN PGM {self.program.name} MM", *self.describe(), f"TOOL CALL {frames.tool.number} Z"]
        lines += [*self._home(), f"CYCL DEF 247 DATUM SETTING ~\r\n  Q339=+{frames.work.number} ;DATUM NUMBER"]
        if blend:
            lines += ["CYCL DEF 32.0 TOLERANCE", f"CYCL DEF 32.1 T{blend:.3f}"]
        if self.machine.rotary:
            lines += [f"L {self._rotary(0)} R0 FMAX", "M128"]
        return lines

    def move(self, k: int) -> list[str]:
        words = ["LN" if self.has_vectors else "L", self._signed("XYZ", self.moves.points[k], 4)]
        if self.has_vectors:
            words.append(self._signed(["NX", "NY", "NZ"], self.moves.normals[k], 7))
            words.append(self._signed(["TX", "TY", "TZ"], self.moves.axes[k], 7))
        else:
            words += [self._rotary(k)] if self.machine.rotary else []
            words.append("R0")
        # FMAX is good for one block only, F until the next
        words.append("FMAX" if k == 0 else self.only_new("F", self.feed(k)))
        return [" ".join(filter(None, words))]

    def wait(self, seconds: float) -> list[str]:
        return ["CYCL DEF 9.0 DWELL TIME", f"CYCL DEF 9.1 DWELL {seconds:.3f}"]

    def note(self, text: str) -> str:
        return f"; {text}"

    def end(self) -> list[str]:
        stop = ["M129"] if self.machine.rotary else []
        return [*stop, *self._home(), "M30", f"END PGM {self.program.name} MM"]

    def finish(self, lines: list[str]) -> list[str]:
        return [f"{number} {line}" for number, line in enumerate(lines)]

    def _signed(self, names: str | Sequence[str], values: Floats, decimals: int) -> str:
        return format_words([f"{name}+" for name in names], values, decimals).replace("+-", "-")

    def _rotary(self, k: int) -> str:
        return self._signed([axis.name for axis in self.machine.rotary], self.at.rotary[k], 4)

    def _home(self) -> list[str]:
        return [f"L {part} R0 FMAX M91" for part in self.split_home("+") if part]

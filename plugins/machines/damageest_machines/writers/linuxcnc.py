"""LinuxCNC (RS-274/NGC), read by its own interpreter in the tests.

Facts: "LinuxCNC G-codes" and "M-codes" of its documentation: G64 P (blending), G61 (exact path), G53 (the machine's
frame), G93 and G94, G4 P in seconds, M64 and M65 (digital outputs), M68 (analogue outputs); kinematics modules such as
xyzac-trt-kins keep the tool's point.
"""

from __future__ import annotations

import numpy as np

from damageest_machines.post import CncPost, format_words


class LinuxCnc(CncPost):
    """G1; with ``post.tcp: control`` by the kinematics module, with ``table`` the points are turned with the table, and
    each move has its time (G93)."""

    suffix = "linuxcnc.ngc"
    tables = True

    def begin(self) -> list[str]:
        blend, frames = self.machine.post.blend, self.machine.frames
        self.is_table = bool(self.machine.rotary) and self.machine.post.tcp == "table"
        self.smooth = f"G64 P{blend:.3f}" if blend else "G61"
        lines = [*self.describe(), f"G17 G21 G40 G49 G80 G90 G94 {frames.work.name}", *self._home()]
        return [*lines, f"T{frames.tool.number} M6", f"G43 H{frames.tool.number}", self.smooth]

    def move(self, k: int) -> list[str]:
        points = self.at.turned if self.is_table else self.moves.points
        words = [self.only_new("G", "0" if k == 0 else "1"), format_words("XYZ", points[k], 5)]
        if self.machine.rotary:
            words.append(format_words([axis.name for axis in self.machine.rotary], self.at.rotary[k], 5))
        if k and self.is_table:
            words.append(f"F{1 / self._measure(k):.4f}")
        elif k:
            words.append(self.only_new("F", self.feed(k)))
        if k == 1 and self.is_table:
            words.insert(0, "G93")
        stop = self.only_new("", "G61" if self.program.exact[k] else self.smooth)
        return [*filter(None, [stop]), " ".join(filter(None, words))]

    def wait(self, seconds: float) -> list[str]:
        return [f"G4 P{seconds:.3f}"]

    def note(self, text: str) -> str:
        return f"({text})"

    def end(self) -> list[str]:
        return ["G94", *self._home(), "M2"]

    def _measure(self, k: int) -> float:
        """Minutes of a move."""
        length = float(np.linalg.norm(self.moves.points[k] - self.moves.points[k - 1]))
        turns = np.abs(self.at.rotary[k] - self.at.rotary[k - 1])
        slow = max((turn / axis.speed / 60 for turn, axis in zip(turns, self.machine.rotary, strict=True)), default=0.0)
        return max(length / float(self.moves.feed[k]), slow, 1e-6)

    def _home(self) -> list[str]:
        self.told.pop("G", None)
        return [f"G53 G0 {part}" for part in self.split_home() if part]

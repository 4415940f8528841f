"""Siemens SINUMERIK 840D sl.

Facts: Siemens, "SINUMERIK 840D sl / 828D, Programming Manual, Job Planning" (6FC5398-2BP40), chapter Transformations:
TRAORI, TRAFOOF; ORIWKS; the tool axis as direction vector A3 B3 C3, which points from the work to the tool's holder, in
any length, or as positions of the rotary axes; ORIVECT turns the tool in the plane of both axes, ORIAXES turns the
rotary axes evenly. "Fundamentals": G9, G642 with ADIS, SUPA, G4 F.
"""

from __future__ import annotations

from damageest_machines.post import CncPost, format_words


class Sinumerik(CncPost):
    """G1 in the frame of the work offset; with rotary axes by TRAORI."""

    suffix = "mpf"

    def begin(self) -> list[str]:
        machine, frames = self.machine, self.machine.frames
        lines = [*self.describe(), "G17 G40 G71 G90 G94", f"G642 ADIS={machine.post.blend:.3f}", *self._home()]
        lines.append(f"T{frames.tool.number} D1")
        if machine.rotary:
            words = "ORIVECT" if self.has_vectors else "ORIAXES"
            lines += [f"G0 {self._rotary(0)}", "TRAORI", f"{frames.work.name}", "ORIWKS", words]
        else:
            lines.append(frames.work.name)
        return lines

    def move(self, k: int) -> list[str]:
        words = [self.only_new("G", "0" if k == 0 else "1"), "G9" if self.program.exact[k] and k else ""]
        words.append(format_words("XYZ", self.moves.points[k], 4))
        if self.has_vectors:
            words.append(format_words(["A3=", "B3=", "C3="], self.moves.axes[k], 8))
        elif self.machine.rotary:
            words.append(self._rotary(k))
        words.append(self.only_new("F", self.feed(k)) if k else "")
        return [" ".join(filter(None, words))]

    def wait(self, seconds: float) -> list[str]:
        return [f"G4 F{seconds:.3f}"]

    def note(self, text: str) -> str:
        return f"; {text}"

    def end(self) -> list[str]:
        return [*(["TRAFOOF"] if self.machine.rotary else []), *self._home(), "M30"]

    def _rotary(self, k: int) -> str:
        return format_words([f"{axis.name}=" for axis in self.machine.rotary], self.at.rotary[k], 4)

    def _home(self) -> list[str]:
        """Z first, then the others, in the machine's frame and without the tool's length."""
        z, others = self.split_home()
        found = [f"G0 SUPA D0 {part}" for part in (z, others) if part]
        self.told.pop("G", None)
        return found

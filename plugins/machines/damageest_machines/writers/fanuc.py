"""Fanuc TP programs as text (.ls), for R-30iA and R-30iB.

Facts: FANUC, "R-30iB controller operator's manual (basic operation)", B-83284EN, and the ASCII upload of the option
R507: /PROG, /ATTR, /MN, /POS, /END; a position has UF, UT, CONFIG, X, Y, Z in mm and W, P, R about x, y, z; further
groups have joints; FINE stops at the point, CNT0 slows to it; a remark has 32 characters. With COORD (coordinated
motion) the positions stay in the user frame, which does not turn with the positioner. The layout is that of programs
which others published.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from damageest.artefacts import Floats
from damageest_machines.frames import read_angles
from damageest_machines.post import Post

CONFIG = "N U T, 0, 0, 0"
NAMES = (("X", "mm"), ("Y", "mm"), ("Z", "mm"), ("W", "deg"), ("P", "deg"), ("R", "deg"))


class Fanuc(Post):
    """Linear moves to positions in group 1, the positioner's axes in group 2."""

    suffix = "ls"
    serves = "robot"

    def begin(self) -> list[str]:
        assert self.at.still is not None
        self.places: list[str] = []
        self.turns = read_angles(self.at.still)
        frames = self.machine.frames
        return [*self.describe(), f"UFRAME_NUM={frames.work.number}", f"UTOOL_NUM={frames.tool.number}", *self._home()]

    def move(self, k: int) -> list[str]:
        config = self.machine.post.configuration or CONFIG
        head = f"{self._frames()},\t\tCONFIG : '{config}',\n"
        number = self._add(head, NAMES, np.concatenate([self.at.turned[k], self.turns[k]]), self.at.rotary[k])
        speed = f"{self.moves.feed[k] / 60:.1f}".removesuffix(".0")
        stop = "FINE" if self.program.exact[k] else "CNT100"
        return [f"L P[{number}] {speed}mm/sec {stop}{' COORD' if self.machine.rotary else ''}"]

    def wait(self, seconds: float) -> list[str]:
        return [f"WAIT {seconds:.2f}(sec)"]

    def note(self, text: str) -> str:
        return f"!{text[:31].replace(';', ',')}"

    def end(self) -> list[str]:
        return self._home()

    def finish(self, lines: list[str]) -> list[str]:
        rows = [f"{n:4}:{line if line[:2] in ('L ', 'J ') else '  ' + line} ;" for n, line in enumerate(lines, 1)]
        groups = f"1,{'1' if self.machine.rotary else '*'},*,*,*"
        head = [f"/PROG  {self.program.name}", "/ATTR", "OWNER\t\t= MNEDITOR;", 'COMMENT\t\t= "";']
        head += [f"LINE_COUNT\t= {len(rows)};", "PROTECT\t\t= READ_WRITE;", f"DEFAULT_GROUP\t= {groups};", "/MN"]
        return [*head, *rows, "/POS", *self.places, "/END"]

    def _home(self) -> list[str]:
        home = self.machine.home
        names = [(f"J{k}", "deg") for k in range(1, 7)]
        joints = np.array([home.get(f"A{k}", 0.0) for k in range(1, 7)])
        extra = np.array([home.get(axis.name, 0.0) for axis in self.machine.rotary])
        return [f"J P[{self._add(self._frames() + ',', names, joints, extra)}] 10% FINE"] if "A1" in home else []

    def _frames(self) -> str:
        return f"UF : {self.machine.frames.work.number}, UT : {self.machine.frames.tool.number}"

    def _add(self, head: str, names: Sequence[tuple[str, str]], values: Floats, extra: Floats) -> int:
        """The number of a new position; positions have four decimals, more than the control shows."""
        words = [f"\t{name} = {value:z.4f} {unit}" for (name, unit), value in zip(names, values, strict=True)]
        text = f"P[{len(self.places) + 1}]{{\n   GP1:\n\t{head}{','.join(words)}"
        if len(extra):
            more = ",".join(f"\tJ{k} = {value:z.4f} deg" for k, value in enumerate(extra, 1))
            text += f"\n   GP2:\n\t{self._frames()},{more}"
        self.places.append(text + "\n};")
        return len(self.places)

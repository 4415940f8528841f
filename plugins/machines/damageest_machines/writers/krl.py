"""KUKA KRL (KRC 2, KRC 4).

Facts: KUKA System Software 8.3, "Operating and Programming Instructions for System Integrators": frames are {X, Y, Z,
A, B, C} with A, B, C about z, y, x; $BASE, $TOOL; $VEL.CP in m/s; LIN ... C_DIS passes within $APO.CDIS mm; $OUT and
$ANOUT stop the advance run, so a point before them is run to exactly; the first motion is a PTP that fixes the axes, or
S and T. "Configuration of kinematic systems" (external axes): $BASE of a positioner is EK(root, type, offset), as in
BAS.SRC.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest_machines.definition import Machine
from damageest_machines.frames import read_angles
from damageest_machines.post import Post, format_words


class Krl(Post):
    """LIN with the tool's frame; positioner axes as E1, E2. The base moves with the positioner."""

    suffix = "src"
    serves = "robot"

    @classmethod
    def check_machine(cls, machine: Machine) -> None:
        """Refuses a machine that does not say how its program begins."""
        if "A1" not in machine.home and not machine.post.configuration:
            raise StageError(
                "a KRL program has to begin with known axes", "home (A1 to A6) or post.configuration (S 2,T 35)"
            )

    def begin(self) -> list[str]:
        machine, number = self.machine, self.machine.frames.work.number
        lines = [f"DEF {self.program.name}( )", *self.describe(), "BAS(#INITMOV,0)"]
        if machine.rotary:
            lines.append(f"$BASE=EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,BASE_DATA[{number}])")
        else:
            lines.append(f"$BASE={self._frame(self.at.base)}")
        lines += [f"$TOOL={self._frame(self.at.tool)}", "$IPO_MODE=#BASE", "$ORI_TYPE=#VAR"]
        lines += [f"$APO.CDIS={machine.post.blend:.3f}", *self._home()]
        self.turns = read_angles(self.at.frames) if self.at.frames is not None else np.empty((0, 3))
        return lines

    def move(self, k: int) -> list[str]:
        words = format_words(["X ", "Y ", "Z "], self.moves.points[k], 4, ",")
        words += "," + format_words(["A ", "B ", "C "], self.turns[k, ::-1], 5, ",")
        for axis, angle in zip(self.machine.rotary, self.at.rotary[k], strict=True):
            words += "," + format_words([f"{axis.name} "], np.array([angle]), 4)
        speed = self.only_new("$VEL.CP=", f"{self.moves.feed[k] / 60000:.6f}")
        if k == 0 and self.machine.post.configuration:
            return [*filter(None, [speed]), f"PTP {{{words},{self.machine.post.configuration}}}"]
        end = "" if self.program.exact[k] else " C_DIS"
        return [*filter(None, [speed]), f"LIN {{{words}}}{end}"]

    def wait(self, seconds: float) -> list[str]:
        return [f"WAIT SEC {seconds:.3f}"]

    def note(self, text: str) -> str:
        return f";{text}"

    def end(self) -> list[str]:
        return [*self._home(), "END"]

    def _home(self) -> list[str]:
        names = [*(f"A{k}" for k in range(1, 7)), *(axis.name for axis in self.machine.rotary)]
        words = [f"{name} {self.machine.home[name]:.4f}" for name in names if name in self.machine.home]
        return [f"PTP {{{','.join(words)}}}"] if "A1" in self.machine.home else []

    def _frame(self, T: Floats) -> str:
        words = format_words(["X ", "Y ", "Z "], T[:3, 3], 4, ",")
        return f"{{{words},{format_words(['A ', 'B ', 'C '], read_angles(T[None, :3, :3])[0, ::-1], 5, ',')}}}"

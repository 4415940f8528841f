"""ABB RAPID (IRC5, OmniCore).

Facts: ABB, "Technical reference manual, RAPID Instructions, Functions and Data types" (3HAC050917): robtarget is
[trans, rot, robconf, extax], rot a quaternion with the scalar first; speeddata [v_tcp, v_ori, v_leax, v_reax] in mm/s
and degrees/s; zonedata; tooldata, wobjdata; 9E9 for axes that are not there; a stop point `fine` is reached before what
follows is done; ConfL\\Off lets MoveL take the nearest configuration.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest_machines.frames import read_quaternions
from damageest_machines.post import Post

NO_AXIS = "9E9"


class Rapid(Post):
    """MoveL with inline targets; the positioner's axes as eax_a, eax_b. With a positioner the work object is the one
    of this number in the control, since it moves with the mechanical unit."""

    suffix = "mod"
    serves = "robot"

    def begin(self) -> list[str]:
        machine, blend = self.machine, self.machine.post.blend
        self.wobj = f"wobj{machine.frames.work.number}"
        self.tool = f"tool{machine.frames.tool.number}_{self.program.settings.site}"
        assert self.at.frames is not None
        self.turns = read_quaternions(self.at.frames)
        lines = [f"MODULE {self.program.name}_M", *self.describe()]
        lines.append(f"PERS tooldata {self.tool}:=[TRUE,{self._pose(self.at.tool)},[1,[0,0,1],[1,0,0,0],0,0,0]];")
        if not machine.rotary:
            self.wobj += f"_{self.program.settings.site}"
            frame = self._pose(self.at.base)
            lines.append(f'PERS wobjdata {self.wobj}:=[FALSE,TRUE,"",{frame},[[0,0,0],[1,0,0,0]]];')
        zone = f"{blend:.3f},{blend:.3f},{blend:.3f},0.1,{blend:.3f},0.1"
        lines += [f"CONST zonedata zpass:=[FALSE,{zone}];", f"PROC {self.program.name}()", "ConfL\\Off;"]
        return [*lines, *self._home()]

    def move(self, k: int) -> list[str]:
        point = ",".join(f"{value:.4f}" for value in np.round(self.moves.points[k], 4) + 0.0)
        turn = ",".join(f"{value:.9f}" for value in np.round(self.turns[k], 9) + 0.0)
        speed = f"[{self.moves.feed[k] / 60:.3f},90,500,90]"
        zone = "fine" if self.program.exact[k] else "zpass"
        target = f"[[{point}],[{turn}],[0,0,0,0],{self._extra(self.at.rotary[k])}]"
        return [f"MoveL {target},{speed},{zone},{self.tool}\\WObj:={self.wobj};"]

    def wait(self, seconds: float) -> list[str]:
        return [f"WaitTime {seconds:.3f};"]

    def note(self, text: str) -> str:
        return f"! {text}"

    def end(self) -> list[str]:
        return [*self._home(), "ENDPROC", "ENDMODULE"]

    def _home(self) -> list[str]:
        home = self.machine.home
        joints = ",".join(f"{home.get(f'A{k}', 0.0):.4f}" for k in range(1, 7))
        extra = self._extra(np.array([home.get(axis.name, 0.0) for axis in self.machine.rotary]))
        return [f"MoveAbsJ [[{joints}],{extra}]\\NoEOffs,v100,fine,{self.tool};"] if "A1" in home else []

    def _extra(self, angles: Floats) -> str:
        words = [f"{value:.4f}" for value in np.round(angles, 4) + 0.0]
        return f"[{','.join([*words, *[NO_AXIS] * (6 - len(words))])}]"

    def _pose(self, T: Floats) -> str:
        turn = read_quaternions(T[None, :3, :3])[0]
        parts = [",".join(f"{value:.9g}" for value in part + 0.0) for part in (T[:3, 3], turn)]
        return f"[[{parts[0]}],[{parts[1]}]]"

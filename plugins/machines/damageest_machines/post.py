"""What all writers share. A dialect is a class derived from `Post`, of a few lines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from damageest.artefacts import DepositPath, Floats
from damageest.errors import StageError
from damageest.stages.export import PathSettings, PathWriter, describe_setup
from damageest_machines.build import build_program, check_machine
from damageest_machines.definition import Machine
from damageest_machines.files import find_file, read_machine
from damageest_machines.moves import TO_MM, TURNED_BACK
from damageest_machines.program import Program
from damageest_machines.rotary import find_ambiguous


class Post(ABC):
    """Writes a program in the words of one control. Made anew for each program.

    A derived class gives ``suffix``, ``serves`` and five methods: `begin` and `end` give the first and last lines,
    `move` those of one move, `wait` those of a pause, `note` a comment. ``self.program`` has all that is to be written.
    """

    suffix: ClassVar[str]
    serves: ClassVar[Literal["robot", "cnc"]]
    """Whether it writes for robots or for machine tools."""
    newline: ClassVar[str] = "\n"

    @classmethod
    def check_machine(cls, machine: Machine) -> None:
        """Raises StageError where no program for this machine can be written, whatever the path: one without moves can.
        Called before the path is planned, and again for the program."""
        return

    def __init__(self, program: Program) -> None:
        self.check_machine(program.machine)
        self.program = program
        self.machine, self.moves, self.at = program.machine, program.moves, program.at
        self.told: dict[str, str] = {}

    @abstractmethod
    def begin(self) -> list[str]: ...

    @abstractmethod
    def end(self) -> list[str]: ...

    @abstractmethod
    def move(self, k: int) -> list[str]:
        """The lines of the move to point ``k``."""

    @abstractmethod
    def wait(self, seconds: float) -> list[str]: ...

    @abstractmethod
    def note(self, text: str) -> str: ...

    def line(self, text: str) -> list[str]:
        """A line of the machine file, as a command of the process."""
        return [text]

    def only_new(self, word: str, value: str) -> str:
        """The word with its value where it differs from the one that was written before, else nothing."""
        if self.told.get(word) == value:
            return ""
        self.told[word] = value
        return word + value

    def finish(self, lines: list[str]) -> list[str]:
        """The lines of the whole program, numbered where the control wants that."""
        return lines

    def describe(self) -> list[str]:
        """Comments for the head: what the program is for."""
        program, path = self.program, self.program.path
        factor = TO_MM[program.settings.unit]
        texts = [
            program.title,
            f"machine {self.machine.name}, {len(self.moves.points)} moves, about {program.minutes:.1f} min",
            f"mm; points are on top of the beads, {path.standoff * factor:g} mm below the tip of the nozzle",
        ]
        return [self.note(_to_ascii(text)) for text in (*texts, *describe_setup(path, factor))]

    def write(self) -> str:
        """The whole program."""
        lines = self.begin()
        lines += self.machine.post.head
        for step in self.program.list_steps():
            if step.what == "move":
                lines += self.move(step.number)
            elif step.what == "wait":
                lines += self.wait(step.seconds)
            elif step.what == "line":
                lines += self.line(step.text)
            else:
                lines.append(self.note(step.text))
        lines += self.machine.post.foot
        return self.newline.join(self.finish([*lines, *self.end()])) + self.newline


class CncPost(Post):
    """For machine tools: the tool axis as angles or as a vector."""

    serves: ClassVar[Literal["robot", "cnc"]] = "cnc"
    tables: ClassVar[bool] = False
    """Whether it writes programs for controls that know no tool centre point."""

    @classmethod
    def check_machine(cls, machine: Machine) -> None:
        """Refuses a control without tool centre point, unless the class writes for one."""
        if machine.rotary and machine.post.tcp == "table" and not cls.tables:
            raise StageError(f"the format .{cls.suffix} leaves the tool's point to the control", "post.tcp: control")

    def __init__(self, program: Program) -> None:
        super().__init__(program)
        machine = self.machine
        self.has_vectors = bool(machine.rotary) and machine.post.orientation == "vectors"
        if self.has_vectors:
            self._check_vectors()

    def _check_vectors(self) -> None:
        up = np.array([0.0, 0.0, 1.0])
        directions = self.moves.axes @ self.at.base[:3, :3].T
        found = find_ambiguous(self.machine.rotary, self.at.rotary, directions, up)
        # a vector that stays does not turn an axis back
        stays = np.linalg.norm(np.diff(directions, axis=0, prepend=directions[:1]), axis=1) < 1e-6
        turns = np.abs(np.diff(self.at.rotary, axis=0, prepend=self.at.rotary[:1])).max(axis=1) > 0.01
        found = np.union1d(found, np.flatnonzero(stays & turns & (self.moves.source == TURNED_BACK)))
        if len(found):
            raise StageError(
                "from the tool axes alone the control would come to other rotary angles than those that were checked: "
                f"{self.moves.describe(int(found[0]))}",
                "post.orientation: axes in the machine file",
            )

    def feed(self, k: int) -> str:
        """The speed of a move in mm a minute."""
        return f"{self.moves.feed[k]:.3f}".rstrip("0").rstrip(".")

    def split_home(self, sign: str = "") -> tuple[str, str]:
        """Words of the home position, in the machine's frame: of Z, and of the other axes; empty without any."""
        home = self.machine.home
        names = ["Z", *(name for name in ("X", "Y", *(axis.name for axis in self.machine.rotary)))]
        words = [f"{name}{home[name]:{sign}.4f}" if name in home else "" for name in names]
        return words[0], " ".join(filter(None, words[1:]))


def check_dialect(post: type[Post], machine: Machine) -> None:
    """Raises StageError where a dialect has no words for a machine."""
    kind = "cnc" if machine.robot is None else "robot"
    if kind != post.serves:
        words = {"cnc": "machine tools", "robot": "robots"}
        raise StageError(
            f"the format .{post.suffix} is for {words[post.serves]}, and {machine.name} is none of them",
            "another export.machine, or another format in export.paths",
        )
    post.check_machine(machine)


def make_writer(post: type[Post]) -> PathWriter:
    """A writer of paths for the hook `damageest_path_writers`. It reads the machine of the job, and refuses a path that
    the machine cannot run."""

    def write(file: Path, path: DepositPath, settings: PathSettings) -> Sequence[str]:
        machine = read_machine(find_file(settings.machine))
        check_dialect(post, machine)
        if not len(path.points):
            file.write_text("", encoding="ascii")
            return ["is empty: the path has no pass"]
        program = build_program(path, settings, machine)
        file.write_bytes(post(program).write().encode("ascii", "replace"))
        return program.notes

    def check(settings: PathSettings, channels: Sequence[str]) -> None:
        machine = read_machine(find_file(settings.machine))
        check_dialect(post, machine)
        check_machine(machine, channels)

    return PathWriter(write, post.suffix, check)


def format_words(names: str | Sequence[str], values: Floats, decimals: int, join: str = " ") -> str:
    """Words of a block: X1.0000 Y2.0000. No value is written as -0."""
    return join.join(
        f"{name}{value:.{decimals}f}" for name, value in zip(names, np.round(values, decimals) + 0.0, strict=True)
    )


def _to_ascii(text: str) -> str:
    return text.encode("ascii", "replace").decode().replace("(", "[").replace(")", "]")

"""Stage `export`: its contract, and what a writer of a file format gets and gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from damageest.artefacts import Floats, Solid
from damageest.result import Result
from damageest.stages import Stage, asked_by_name


@dataclass(frozen=True)
class ExportedFiles:
    """``files``: paths relative to the folder that they were written to. ``notes``: what became other than asked for.

    ``splines``: per site, how well a spline follows its inner damage surface; empty where none was asked for.
    """

    files: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    splines: Mapping[int, Spline] = field(default_factory=dict)


@dataclass(frozen=True)
class Spline:
    """``deviation``: the largest distance between surface and spline, either way, None where there is no spline;
    ``trimmed``: whether it ends at the surface's rim; ``reason``: why it was not written, empty where it was."""

    deviation: float | None = None
    trimmed: bool = False
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Body:
    """A solid to be written: ``name`` for whoever opens the file, ``colour`` red, green, blue from 0 to 255."""

    name: str
    solid: Solid
    colour: tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Patch:
    """A B-spline surface, clamped: ``degree`` in both directions, ``knots`` with their repetitions (U + degree + 1,)
    and (V + degree + 1,), ``poles`` (U,V,3). ``rims``: closed loops (K,2) of parameters that bound it, the outer one
    first; none where it ends at the poles' edges."""

    degree: int
    knots: tuple[Floats, Floats]
    poles: Floats
    rims: tuple[Floats, ...] = ()


WriteFunction = Callable[[Path, str, Sequence[Body], str], ExportedFiles]
"""Of ``folder, stem, bodies, unit``: writes ``folder/stem.suffix``; ``stem`` may lead through folders that are there.
``unit`` is one of um, mm, cm, m, in, ft. The same bodies give the same bytes. What cannot be written well is left out,
and a note says why."""


@dataclass(frozen=True)
class Writer:
    """How a format is written. ``together``: all bodies of a result go into one file. ``costly``: each facet costs so
    much there that it gets simplified solids. ``patch`` writes a spline, of ``path, name, patch, unit``; None where the
    format has no such thing."""

    write: WriteFunction
    one_file: bool = False
    simplify: bool = False
    patch: Callable[[Path, str, Patch, str], None] | None = None


class Export(Stage, ABC):
    """Writes the result into a folder that the engine made and will move into place (end of paper 3.2).

    ``result``: everything computed. ``folder``: an existing, empty folder. ``writers``: those of the built-ins and the
    plugins, by format.
    """

    stage: ClassVar[str] = "export"
    gives: ClassVar[str] = "written"

    @asked_by_name
    @abstractmethod
    def run(self, result: Result, folder: Path, writers: Mapping[str, Writer]) -> ExportedFiles: ...

"""Stage `export`: its contract, and the interface of writers of file formats."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np

from damageest.artefacts import DepositPath, Floats, Solid
from damageest.artefacts.fields import Checked
from damageest.result import Result
from damageest.stages import Stage, asked_by_name


@dataclass(frozen=True)
class ExportedFiles(Checked):
    """The files of an export.

    ``files``: paths relative to the output folder. ``splines``: for each site, by
    its number, the fit of a spline to its inner damage surface; empty without splines in the job. ``exact``: for each
    site, by its number, whether its solid has the CAD's own faces; empty without exact solids in the job. ``warnings``:
    the notes that the run prints at its end.
    """

    files: Annotated[
        tuple[str, ...],
        "all that were written, in the part's frame, which is that of the adapted part where adapt is not "
        "null; those below scan_frame/ are in the scan's frame, those below nominal_frame/ on the part as designed",
    ] = ()
    notes: Annotated[tuple[str, ...], "differences from the job, with the reason"] = ()
    splines: Mapping[int, Spline] = field(default_factory=dict)
    exact: Mapping[int, ExactForm] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Spline:
    """How well a spline fits an inner damage surface."""

    deviation: Annotated[float | None, "largest distance between surface and spline, either way"] = None
    trimmed: Annotated[bool, "whether it ends at the surface's rim; otherwise it reaches beyond"] = False
    reason: Annotated[str, "why there is no spline; empty where there is one"] = ""


@dataclass(frozen=True)
class ExactForm:
    """How a damage volume was written whose outer faces are the CAD's own. What lies less than a quarter of the
    tolerance below the skin counts as near."""

    form: Annotated[
        str,
        "form of the inner surface: shapes (planes, cylinders, spheres), spline, planes (beside "
        "facets), facets; none: facets all over",
    ]
    faces: int = 0
    inner_faces: Annotated[int, "faces inside the part"] = 0
    volume: float | None = None
    distance: Annotated[float | None, "95 % of the inner surface are as near to the mesh's, both ways"] = None
    farthest: Annotated[float | None, "largest distance of the inner surfaces, both ways"] = None
    beyond: Annotated[float | None, "share of the inner surface farther than a quarter of the tolerance"] = None
    seconds: Annotated[float, "processor time"] = 0.0
    tried: Annotated[tuple[str, ...], "forms refused before, with reasons"] = ()
    deposit: Annotated[DepositForm | None, "null where there is none beside the damage volume"] = None
    milled: Annotated[MilledForm | None, "null where the cavity was not opened before deposition"] = None


@dataclass(frozen=True)
class MilledForm:
    """How the metal was written that is milled off before deposition, and whose outer faces are the CAD's own."""

    form: Annotated[str, "form of the milled surface, as that of the damage volume; none: facets"]
    faces: int = 0
    prepared_faces: Annotated[int, "faces that milling leaves"] = 0
    volume: float | None = None
    distance: Annotated[float | None, "95 % of the surface that milling leaves are as near to the mesh's"] = None
    farthest: Annotated[float | None, "largest distance of these surfaces, both ways"] = None
    beyond: Annotated[float | None, "share of that surface farther than a quarter of the tolerance"] = None
    seconds: Annotated[float, "processor time"] = 0.0
    tried: Annotated[tuple[str, ...], "forms refused before for the opened cavity, with reasons"] = ()
    reason: Annotated[str, "why it has facets; empty where it has CAD faces"] = ""


@dataclass(frozen=True)
class DepositForm:
    """How a deposit was written whose stock is the offset of the part's CAD faces."""

    faces: int = 0
    offsets: Annotated[int, "faces that are offsets of CAD faces, at the height of the stock"] = 0
    volume: float | None = None
    distance: Annotated[
        float | None,
        "95 % of the stock's surface, but for that within 1.5 tolerances of the damage's outline, are as "
        "near to the mesh's, both ways, with stock as high as the mesh's",
    ] = None
    farthest: Annotated[float | None, "largest distance between them, both ways"] = None
    seconds: Annotated[float, "processor time"] = 0.0
    reason: Annotated[str, "why it has facets; empty where it has CAD faces"] = ""


@dataclass(frozen=True, eq=False)
class Body:
    """A solid to write: ``name`` as shown by programs that open the file; ``colour``: red, green, blue, 0 to 255."""

    name: str
    solid: Solid
    colour: tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Patch:
    """A clamped B-spline surface.

    ``degree``: in both directions. ``knots``: (U + degree + 1,) and (V + degree + 1,), each as often as its
    multiplicity. ``poles``: (U,V,3). ``rims``: closed loops (K,2) in the surface's parameters that bound it, the outer
    one first; empty where it ends at the edges of its parameter range.
    """

    degree: int
    knots: tuple[Floats, Floats]
    poles: Floats
    rims: tuple[Floats, ...] = ()


WriteFunction = Callable[[Path, str, Sequence[Body], str], ExportedFiles]
"""A function of ``folder, stem, bodies, unit`` that writes ``folder/stem.suffix``.

``stem`` may contain existing folders. ``unit`` is one of um, mm, cm, m, in, ft. The same bodies give the same bytes.
What the format cannot hold is left out, and a note says why."""


ExactFunction = Callable[[Path, Result, Mapping[str, Body], Mapping[str, Floats | None], float, float], ExportedFiles]
"""A function of ``folder, result, bodies, places, seconds, budget`` that writes solids with the CAD's own faces.

``bodies``: what is to be written, by the stem of its file, in the part's frame; ``places``: the folders, as a prefix of
the stem, with the transform (4,4) of a point from the part's frame, None for none; ``seconds``: the time limit for each
site, and ``budget`` for all of it, of the processor. Gives the files that it wrote; those of other bodies are then
written as usual."""

DocumentFunction = Callable[[Path, Result], ExportedFiles]
"""A function of ``folder, result`` that writes files about the whole result, in the part's frame. The same result gives
the same bytes."""


@dataclass(frozen=True)
class Writer:
    """How a format is written.

    ``write``: writes solids. ``one_file``: whether all solids of a result go into one file. ``simplify``: whether it
    gets simplified solids, because each facet makes the file much larger. ``patch``: writes a spline, with the
    arguments ``path, name, patch, unit``, and gives a note on the file that follows its name, empty
    for none; ``patch`` is None where the format cannot hold one. ``exact``: writes solids whose outer
    faces are those of the part's CAD file; None where the format has only facets.
    ``single``: whether readers round coordinates to single precision; it then gets solids that this does not open, with
    the same triangles in each frame. ``document``: for a format that holds the result as a whole: it is called once,
    and ``write`` is not called for any solid.
    """

    write: WriteFunction
    one_file: bool = False
    simplify: bool = False
    patch: Callable[[Path, str, Patch, str], str | None] | None = None
    exact: ExactFunction | None = None
    single: bool = False
    document: DocumentFunction | None = None


@dataclass(frozen=True)
class PathSettings:
    """How a path is written. ``unit``: of its lengths, one of um, mm, cm, m, in, ft. ``title``: of job and site.
    ``header``, ``footer``: templates of the first and last lines, None for the writer's own. ``options``: what else the
    job says for the writer, by name. ``site``: number of the site. ``machine``: the file that defines
    the machine, or the name, a text, of one that a plugin brings; None for none."""

    unit: str
    title: str
    header: str | None = None
    footer: str | None = None
    options: Mapping[str, str] = field(default_factory=dict)
    site: int = 1
    machine: Path | str | None = None


CheckFunction = Callable[[PathSettings, Sequence[str]], None]
"""A function of ``settings, channels`` that raises StageError, or JobError for a file, where no path could be written
with these settings; ``channels``: the names of those that the paths will have. It imports no more than it needs."""


@dataclass(frozen=True)
class PathWriter:
    """How a deposition path is written. ``write``: a function of ``file, path, settings``, a file to create, the path
    in the frame asked for, or in its set-up frame where it has one (`DepositPath.setup` then takes points of the frame
    asked for to it), and a `PathSettings`; the same path gives the same bytes. It gives notes, which the run prints at
    its end, or None, and raises StageError for a path that the format cannot hold or the machine cannot run: then there
    is no file. ``suffix``: of the file, without the dot. ``check``: called before anything is computed; None for
    none. ``reach``: gives the tool axes that the machine reaches, see the stage `path`; None for all."""

    write: Callable[[Path, DepositPath, PathSettings], Sequence[str] | None]
    suffix: str
    check: CheckFunction | None = None
    reach: Callable[[PathSettings], Floats | None] | None = None


def describe_setup(path: DepositPath, factor: float = 1.0) -> list[str]:
    """Lines for the head of a program that say how to set up the part; none for a path without a set-up frame.
    ``factor``: from the path's unit to that of the file."""
    if path.setup is None or np.array_equal(path.setup, np.eye(4)):
        return []
    T = path.setup.copy()
    T[:3, 3] *= factor
    rows = [" ".join(f"{value:.9g}" for value in row + 0.0) for row in T[:3]]
    return ["set-up frame, z along the tool: x y z here = rows times x y z 1 of the part file's frame", *rows]


class Export(Stage, ABC):
    """Writes the result to files (end of paper 3.2).

    Args of ``run``:
        result: all that was computed, in the part's frame and in ``result.units``.
        folder: an existing, empty folder. The engine moves it to its final place when all files are written.
        writers: the writers of file formats, of damageest and of the plugins, by the format's name.
        path_writers: the writers of deposition paths, likewise.

    Returns:
        The paths of all files written, relative to ``folder`` and with forward slashes; the same result gives the same
        bytes. ``notes`` list differences from the job, and omissions.

    Raises:
        OSError: where a file cannot be written.

    Example::

        from pathlib import Path
        from typing import Literal
        from damageest.result import Result
        from damageest.stages.export import Export, ExportedFiles

        class Volumes(Export):
            "A text file with the volume of each damage site."
            use: Literal["volumes"] = "volumes"

            def run(self, result: Result, folder: Path) -> ExportedFiles:
                rows = [f"site {site.id}: {site.damage.volume:.6g} {result.units}^3" for site in result.sites]
                (folder / "volumes.txt").write_text("".join(row + "\\n" for row in rows))
                return ExportedFiles(("volumes.txt",))
    """

    stage: ClassVar[str] = "export"
    gives: ClassVar[str] = "written"

    def find_reach(self, path_writers: Mapping[str, PathWriter]) -> Floats | None:
        """The tool axes that the machine of the paths reaches, see the stage `path`; None for all."""
        return None

    @asked_by_name
    @abstractmethod
    def run(
        self,
        result: Result,
        folder: Path,
        writers: Mapping[str, Writer],
        path_writers: Mapping[str, PathWriter],
    ) -> ExportedFiles: ...

"""Measures CAD files of others: a damage on each, and what the STEP files of damage and deposit hold, read back."""

from __future__ import annotations

import dataclasses
import json
import re
import tempfile
import time
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.errors import describe_error
from damageest.geometry.vectors import cross_corners
from damageest_benchmarks.exact.files_rows import read_rows

POINTS = 8_000
NOISE, TOLERANCE = 0.0015, 0.006
"""Of the scan and of the job, in diagonals of the part."""
CHORD = 1 / 32
"""Of the part's triangles, in tolerances: a fourth of the default, so that volumes differ by little because of it."""
STOCK = 2.0
"""Height of the stock on the deposits, in tolerances."""
RADIUS = 3.0
"""Radius of the cutter for which cavities are opened, in tolerances."""
LIMIT = 60.0
"""Longest time for the exact form of a damage volume or of a deposit, in seconds of the processor: the default of
`export.limit`."""
SIZES = (100_000, 300_000)
"""Bytes from which a file comes after the smaller ones."""


def measure_folder(
    folder: Path, output: Path, first: int, seconds: float, prepare: bool = False
) -> Iterator[dict[str, Any]]:
    """A row for each CAD file of ``folder`` that ``output`` has no row of, also appended to it.

    ``first`` changes the random damages. ``seconds``: the longest time for a file, after which its row has an error.
    ``prepare``: whether cavities are opened before deposition.
    """
    from damageest_cadquery.brep import Brep

    done = {row["file"] for row in read_rows(output)}
    files = [each for each in folder.iterdir() if each.suffix.lower() in Brep.reads]
    # smaller ones first, those of about one size in an order that makes a part of them a sample
    for path in sorted(files, key=_rank):
        if path.name in done:
            continue
        start = time.perf_counter()
        row = _measure(path, first, seconds, prepare) | {"seconds": round(time.perf_counter() - start, 1)}
        with output.open("a") as stream:
            stream.write(json.dumps(row) + "\n")
        yield row


def _rank(path: Path) -> tuple[int, int, str]:
    size = path.stat().st_size
    return sum(size > each for each in SIZES), zlib.crc32(path.name.encode()), path.name


def _measure(path: Path, first: int, seconds: float, prepare: bool) -> dict[str, Any]:
    """A row. The run is in one process, which starts but once; where it crashes or is late, the run is repeated in the
    processes that a user's has. Another process reads the files."""
    from damageest.errors import StageError
    from damageest.isolation import Limits, call_isolated, find_place

    start = time.perf_counter()
    limits, read_limits = Limits(seconds=seconds), Limits(seconds=seconds / 2)
    with tempfile.TemporaryDirectory(prefix="damageest-files-") as place:
        arguments = {"path": path, "first": first, "place": Path(place), "prepare": prepare}
        row: dict[str, Any] = {}
        for nested in (False, True):
            try:
                row = call_isolated(
                    measure_file, arguments, worker=f"damageest_cadquery evaluate {nested}", limits=limits,
                    show=False, nested=nested, processor_time=True,
                )  # fmt: skip
                break
            except StageError as error:
                row = {
                    "file": path.name,
                    "error": f"{find_place(error)}: {describe_error(error, 300)}",
                    "kind": "ended",
                }
                if time.perf_counter() - start > 0.9 * seconds:
                    break
        for site in row.get("sites", []):
            for what in ("damage", "deposit", "milled"):
                if what not in site:
                    continue
                given = {"path": Path(place) / f"out/{what}/site-{site['site']}.step", "coloured": row["coloured"]}
                try:
                    site[what] |= call_isolated(
                        read_back, given, worker="damageest_cadquery reads",
                        limits=read_limits, show=False,
                    )  # fmt: skip
                except Exception as error:  # OpenCASCADE's exceptions share no base of their own
                    site[what]["fault"] = f"cannot be read back: {describe_error(error, 300)}"
    return row


def measure_file(path: Path, first: int, place: Path, prepare: bool = False) -> dict[str, Any]:
    """A row: the random damage on the part of a file, and for each site what was written, to ``place``; or
    ``error``, and as ``kind`` whether the file was refused, has no damage, or failed. ``prepare``: whether cavities are
    opened before deposition."""
    from damageest_cadquery.brep import Brep

    from damageest.errors import DamageestError

    row: dict[str, Any] = {"file": path.name, "seed": (first + zlib.crc32(path.name.encode())) % 100_000}
    try:
        diagonal = _measure_diagonal(path)
        tolerance = TOLERANCE * diagonal
        rough = Brep(path=path, chord=tolerance / 4).run(unit="mm", tolerance=None)
    except DamageestError as error:
        return row | {"error": describe_error(error, 300), "kind": "refused"}
    row |= {"diagonal": diagonal, "stock": STOCK * tolerance}
    try:
        kinds, tools = _draw_damage(rough, row["seed"])
    except LookupError as error:
        return row | {"error": describe_error(error, 300), "kind": "no damage"}
    try:
        return row | {"kinds": kinds} | _measure_run(path, place, tolerance, row["seed"], tools, prepare)
    except DamageestError as error:
        return row | {"kinds": kinds, "error": describe_error(error, 300), "kind": "failed"}


def _measure_diagonal(path: Path) -> float:
    from damageest_cadquery.shapes import measure_diagonal, read

    from damageest.errors import InputError

    try:
        model = read(path, path.suffix.lower())
        diagonal = float(measure_diagonal(model.solids))
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"cannot be read: {describe_error(error, 300)}") from error
    if not np.isfinite(diagonal) or diagonal <= 0:
        raise InputError("has no size")
    return diagonal  # OpenCASCADE's lengths are millimetres, but for BREP, which has no unit


def _draw_damage(part: Any, seed: int) -> tuple[list[str], list[dict[str, Any]]]:
    """Kind and tools of one random damage. Raises LookupError where the part has no room for any."""
    from damageest_evaluate.damages import KINDS, make_random_damage

    from damageest.errors import StageError

    try:
        drawn = make_random_damage(part, seed, (list(KINDS)[seed % len(KINDS)],), count=1)
    except (StageError, ValueError) as error:
        raise LookupError(f"no damage fits the part: {describe_error(error, 300)}") from error
    return list(drawn.kinds), [tool.model_dump(mode="json") for tool in drawn.tools]


def _measure_run(
    path: Path, place: Path, tolerance: float, seed: int, tools: Sequence[Any], prepare: bool
) -> dict[str, Any]:
    from damageest_cadquery.exact import write_exact
    from damageest_cadquery.shapes import read, scale_shape

    import damageest
    from damageest.artefacts import Deposit
    from damageest.stages.export import Body
    from damageest_benchmarks.exact.fair import measure_fairly

    allowance: dict[str, Any] = {"use": "milling", "outer": STOCK * tolerance}
    if prepare:
        allowance["prepare"] = {"min_radius": RADIUS * tolerance}
    job = {
        "version": 1, "units": "mm", "tolerance": tolerance, "align": "none",
        "part": {"use": "brep", "path": str(path), "chord": CHORD * tolerance},
        "scan": {"use": "simulate", "points": POINTS, "noise": NOISE * tolerance / TOLERANCE, "seed": seed,
                 "damage": list(tools)},
        "accept": "all", "report": "none", "allowance": allowance,
        "export": {"format": ["stl"]},
    }  # fmt: skip
    result = damageest.run(job, output=place / "run", cache=False)
    said = json.loads((place / "run/result.json").read_text())
    bodies = {}
    for site in result.sites:
        bodies[f"damage/site-{site.id}"] = Body(f"damage site-{site.id}", site.damage, (0, 0, 0))
        if site.deposit is not None:
            bodies[f"deposit/site-{site.id}"] = Body(f"deposit site-{site.id}", site.deposit, (0, 0, 0))
            if isinstance(site.deposit, Deposit) and site.deposit.milled is not None:
                bodies[f"milled/site-{site.id}"] = Body(f"milled site-{site.id}", site.deposit.milled, (0, 0, 0))
    forms = write_exact(place / "out", result, bodies, {"": None}, LIMIT, assembly=False).exact
    coloured = _count_coloured(path)
    solids = [scale_shape(each, result.part.cad_scale) for each in read(path, path.suffix.lower()).solids]
    sites = []
    for site in result.sites:
        exact = json.loads(json.dumps(dataclasses.asdict(forms[site.id])))
        row = {"site": site.id, "exact": exact}
        if exact["form"] != "none":
            row["damage"] = {"mesh": site.damage.volume}
            row["skin"] = _measure_skin(site.damage, result.part)
        made = exact.get("deposit")
        if made and not made["reason"] and site.deposit is not None:
            row["deposit"] = {"mesh": site.deposit.volume}
        elif not made:
            row["no_deposit"] = " ".join("; ".join(result.failures).split())[:300] or "the run gave none"
        opened = site.deposit if isinstance(site.deposit, Deposit) else None
        if opened and opened.milled and opened.cavity and not exact["milled"]["reason"]:
            row["milled"] = {"mesh": opened.milled.volume, "of": opened.cavity.volume}
        if "damage" in row and not prepare:
            truth = result.scan.truth.damage if result.scan.truth else None
            measure_fairly(row, solids, result.part, site.damage, truth, place / "out", tolerance, STOCK * tolerance)
        sites.append(row)
    if not sites:
        return {"error": "the run found no damage", "kind": "no site"}
    return {"coloured": coloured, "sites": sites, "warnings": [str(each)[:200] for each in said.get("warnings", [])]}


def _measure_skin(damage: Any, part: Any) -> float:
    """The area of the part's skin that a damage volume takes, by the mesh."""
    from damageest.geometry.skin import find_inner_faces

    corners = damage.triangles[~find_inner_faces(damage, part)]
    return float(np.linalg.norm(cross_corners(corners), axis=1).sum() / 2)


def _count_coloured(path: Path) -> int:
    """How many CAD faces of a file have a colour."""
    from damageest_cadquery.shapes import explore, read, read_colours
    from OCP.TopAbs import TopAbs_FACE

    solids = read(path, path.suffix.lower()).solids
    count = sum(len(explore(solid, TopAbs_FACE)) for solid in solids)
    return sum(colour is not None for colour in read_colours(path, count))


def read_back(path: Path, coloured: int) -> dict[str, Any]:
    """What is in a STEP file: its text says how many solids and faces were written, a new reader how many there are.
    ``coloured``: how many CAD faces have a colour."""
    from damageest_cadquery.shapes import explore, measure_area, measure_volume, read, read_colours, triangulate
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_FACE

    text = path.read_text(errors="replace")
    model = read(path, ".step")
    faces = [face for solid in model.solids for face in explore(solid, TopAbs_FACE)]
    names = [model.name_of(face) for face in faces]
    colours = read_colours(path, len(faces))
    volume = sum(measure_volume(solid) for solid in model.solids)
    try:
        # where an outline on a spline is long, OpenCASCADE's integrals are wrong by percents
        by_triangles = sum(triangulate(solid, 1e-3 * abs(volume) ** (1 / 3)).volume for solid in model.solids)
    except Exception:
        by_triangles = None
    return {
        "written_solids": len(re.findall(r"=\s*(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS)\s*\(", text)),
        "written_faces": len(re.findall(r"=\s*ADVANCED_FACE\s*\(", text)),
        "solids": len(model.solids),
        "faces": len(faces),
        "valid": all(BRepCheck_Analyzer(solid).IsValid() for solid in model.solids),
        "volume": volume,
        "by_triangles": by_triangles,
        "unnamed": sum(not name for name in names),
        "skin": sum(measure_area(face) for face, name in zip(faces, names, strict=True) if " inner " not in name),
        "without_colour": sum(colour is None for colour in colours) if coloured else 0,
    }

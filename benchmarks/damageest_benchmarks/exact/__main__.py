"""``python -m damageest_benchmarks.exact``: random damages on many parts, and what their exact forms are worth."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.errors import describe_error

POINTS = 40_000
NOISE, TOLERANCE = 0.00075, 0.003
"""Of the scan and of the job, in diagonals of the part."""
COUNT = 3
"""Damages of a case, where the part has room for them."""
STOCK = 2.0
"""Height of the stock on the deposits, in tolerances."""
FINE = 1 / 48
"""Chord, in tolerances, of triangles that stand for CAD faces where these are compared with the part's triangles."""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m damageest_benchmarks.exact", description=__doc__)
    parser.add_argument("--output", type=Path, help="file of rows, one JSON object a line; grows")
    parser.add_argument("--cases", type=int, default=65, help="random damages, spread over the parts")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seconds", type=float, default=1e9, help="start no case after this time")
    parser.add_argument("--step", type=Path, nargs="*", default=[], help="STEP files to use besides the built-in parts")
    parser.add_argument("--files", type=Path, help="folder of CAD files: a damage on each that --output has no row of")
    parser.add_argument("--write", type=Path, help="write the built-in parts as STEP files to this folder, no more")
    parser.add_argument("--prepare", action="store_true", help="of --files: open the cavities before deposition")
    parser.add_argument("--limit", type=float, default=180.0, help="longest time for one of --files, in seconds")
    chosen = parser.parse_args(arguments)
    start = time.perf_counter()
    if chosen.write:
        from damageest_benchmarks.exact.write_parts import write_parts

        print(f"{len(write_parts(chosen.write))} files")
        return
    if chosen.output is None:
        parser.error("--output is missing")
    if chosen.files:
        _measure_files(chosen, start)
        return
    with tempfile.TemporaryDirectory() as place:
        files = [*_write_parts(Path(place)), *chosen.step]
        for number in range(chosen.first, chosen.first + chosen.cases):
            if time.perf_counter() - start > chosen.seconds:
                break
            for row in run_case(files[number % len(files)], number, Path(place) / "out"):
                with chosen.output.open("a") as stream:
                    stream.write(json.dumps(row) + "\n")
                print({key: value for key, value in row.items() if key != "tried"}, flush=True)
    print(summarise([json.loads(line) for line in chosen.output.read_text().splitlines()]))


def _measure_files(chosen: argparse.Namespace, start: float) -> None:
    from damageest_benchmarks.exact.files import measure_folder
    from damageest_benchmarks.exact.files_rows import read_rows, summarise_files

    rows = measure_folder(chosen.files, chosen.output, chosen.first, chosen.limit, chosen.prepare)
    for number, row in enumerate(rows, start=1):
        print(number, f"{time.perf_counter() - start:.0f} s", row["file"], row.get("error", "measured"), flush=True)
        if time.perf_counter() - start > chosen.seconds:
            break
    print(summarise_files(read_rows(chosen.output)))


def _write_parts(folder: Path) -> list[Path]:
    import cadquery as cq

    from damageest_benchmarks.exact.parts import PARTS

    paths = []
    for name, make in PARTS.items():
        paths.append(folder / f"{name}.step")
        cq.exporters.export(make(), str(paths[-1]))
    return paths


def run_case(path: Path, seed: int, output: Path) -> list[dict[str, Any]]:
    """A row for each site of one random damage; a single one with ``error`` where there is none."""
    from damageest_cadquery.brep import Brep
    from damageest_evaluate.damages import KINDS, make_random_damage

    import damageest
    from damageest.errors import DamageestError

    base = {"part": path.stem, "seed": seed}
    try:
        rough = Brep(path=path, chord=0.05).run(unit="mm", tolerance=None)
        tolerance = TOLERANCE * rough.diagonal
        kind = list(KINDS)[seed % len(KINDS)]
        drawn = make_random_damage(rough, seed, (kind,), count=COUNT)  # another kind where the part has no place for it
        scan = {"use": "simulate", "points": POINTS, "noise": NOISE * rough.diagonal, "seed": seed}
        scan["damage"] = [tool.model_dump(mode="json") for tool in drawn.tools]
        job = {
            "version": 1, "units": "mm", "tolerance": tolerance, "part": str(path), "align": "none", "scan": scan,
            "accept": "all", "export": {"format": ["step"], "solids": "exact"}, "report": "none",
            "allowance": {"use": "milling", "outer": STOCK * tolerance},
        }  # fmt: skip
        result = damageest.run(job, output=output, cache=False)
    except (LookupError, DamageestError) as error:
        return [base | {"error": describe_error(error, 300)}]
    said = json.loads((output / "result.json").read_text())
    rows = []
    truth = result.scan.truth.damage if result.scan.truth else None
    chords = Chords(path, result.part, tolerance)
    for site, report in zip(result.sites, said["sites"], strict=True):
        exact = report["exact"]
        row = base | {"kinds": list(drawn.kinds), "site": site.id, "mesh": site.damage.volume} | exact
        if exact["form"] != "none":
            row |= _read_back(output / f"damage/site-{site.id}.step", site.damage, truth, tolerance, chords)
        if exact["deposit"] and not exact["deposit"]["reason"]:
            mesh = {"mesh": site.deposit.volume if site.deposit else None}
            row["deposit"] |= mesh | _read_file(output / f"deposit/site-{site.id}.step")
        rows.append(row)
    if not rows:
        return [base | {"error": "no site"}]
    seconds = next((s["seconds"] for s in said["stages"] if s["stage"] == "export"), 0.0)
    return [row | {"export_seconds": seconds} for row in rows]


class Chords:
    """What the part's triangles cut off its curved faces, or add to them."""

    def __init__(self, path: Path, part: Any, tolerance: float) -> None:
        from damageest_cadquery.brep import Brep

        from damageest.geometry.solids import to_manifold

        self.fine = Brep(path=path, chord=FINE * tolerance).run(unit="mm", tolerance=None)
        self.origin = part.bounds.mean(axis=0)
        self.meshed, self.cad = (to_manifold(solid, self.origin) for solid in (part, self.fine))

    def measure(self, exact: Any, mesh: Any) -> float:
        """How much larger an exact damage volume is than a mesh because of the triangles' chords alone."""
        from damageest.geometry.solids import to_manifold

        first, second = to_manifold(exact, self.origin), to_manifold(mesh, self.origin)
        return float((first - self.meshed).volume() - (second - self.cad).volume())


def _read_file(path: Path) -> dict[str, Any]:
    """What cadquery and gmsh find in a file."""
    import cadquery as cq
    from damageest_cadquery.exact import measure_volume

    solids = cq.importers.importStep(str(path)).solids().vals()
    plain = sum(solid.Volume() for solid in solids)
    gmsh = _read_with_gmsh(path)
    return {
        "read_volume": sum(measure_volume(solid.wrapped) for solid in solids),
        "read_solids": len(solids),
        "read_valid": all(solid.isValid() for solid in solids),
        # gmsh integrates with a fixed number of points, as CadQuery does: the two are compared
        "gmsh": None if gmsh is None else [gmsh[0] / plain - 1, gmsh[1]],
    }


def _read_back(path: Path, mesh: Any, truth: Any, tolerance: float, chords: Chords) -> dict[str, Any]:
    """What is in the file, what chords make of its volume, and IoU of exact form and mesh with the truth around it."""
    from damageest_cadquery.brep import Brep

    from damageest.geometry.solids import iou, to_manifold, to_solid

    row = _read_file(path)
    try:
        fine = Brep(path=path, chord=FINE * tolerance).run(unit="mm", tolerance=None)
        row |= {"fine": fine.volume, "chords": chords.measure(fine, mesh)}
        exact = Brep(path=path, chord=tolerance / 16).run(unit="mm", tolerance=None)
    except Exception as error:
        return row | {"iou_error": str(error)[:200]}
    if truth is None:
        return row
    origin = mesh.bounds.mean(axis=0)
    size = mesh.bounds[1] - mesh.bounds[0] + 8 * tolerance
    from manifold3d import Manifold

    box = Manifold.cube(tuple(size.tolist()), True)
    near = to_solid(to_manifold(truth, origin) ^ box, origin)
    if near is None:
        return row
    return row | {"iou_mesh": iou(near, mesh), "iou_exact": iou(near, exact), "truth": near.volume}


def _read_with_gmsh(path: Path) -> list[float] | None:
    """Volume and number of solids by gmsh; None where it is not installed."""
    try:
        import gmsh
    except (ImportError, OSError):
        return None
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        tags = gmsh.model.occ.importShapes(str(path))
        solids = [tag for dimension, tag in tags if dimension == 3]
        return [sum(gmsh.model.occ.getMass(3, tag) for tag in solids), float(len(solids))]
    finally:
        gmsh.finalize()


def summarise(rows: Sequence[dict[str, Any]]) -> str:
    """The figures over all sites, in words."""
    sites = [row for row in rows if "form" in row]
    good = [row for row in sites if row["form"] != "none"]
    if not good:
        return f"{len(sites)} sites, none exact"
    forms = {
        form: sum(row["form"] == form for row in sites) for form in ("shapes", "spline", "planes", "facets", "none")
    }
    faces, seconds = np.array([row["faces"] for row in good]), np.array([row["seconds"] for row in good])
    lines = [
        f"{len(rows)} damages on {len({row['part'] for row in rows})} parts, {len(sites)} sites; "
        f"exact {len(good) / len(sites):.1%}: {forms}",
        f"seconds a site: median {np.median(seconds):.1f}, 95 % {np.quantile(seconds, 0.95):.1f}",
        f"faces a site: median {np.median(faces):g}, 95 % {np.quantile(faces, 0.95):g}, most {faces.max()}",
        *_compare_volumes(good),
        *_count_reads("damage", [row for row in good if "read_volume" in row]),
    ]
    both = np.array([[row["iou_exact"], row["iou_mesh"]] for row in good if "iou_exact" in row])
    if len(both):
        lines.append(
            f"IoU with the truth: exact median {np.median(both[:, 0]):.4f}, mesh {np.median(both[:, 1]):.4f}; "
            f"exact at least as good in {(both[:, 0] >= both[:, 1]).mean():.0%}, "
            f"worst difference {(both[:, 0] - both[:, 1]).min():+.4f}"
        )
    return "\n".join([*lines, *_summarise_deposits([row["deposit"] for row in good if row.get("deposit")])])


def _compare_volumes(good: Sequence[dict[str, Any]]) -> list[str]:
    """Volumes against those of the meshes, as they are and without what chords of the part's triangles do; by form."""

    def tell(what: str, off: Any) -> str:
        size = np.abs(off)
        return (
            f"{what}: median {np.median(size):.3%}, 95 % {np.quantile(size, 0.95):.3%}, most {size.max():.3%}; "
            f"with its sign {np.median(off):+.3%}"
        )

    lines = [tell("volume against the mesh", np.array([row["volume"] / row["mesh"] - 1 for row in good]))]
    known = [row for row in good if "chords" in row]
    # "fine": by triangles, since integrals over splines with long outlines are not exact
    own = {id(row): (row["fine"] - row["chords"]) / row["mesh"] - 1 for row in known}
    if known:
        lines.append(tell("without the chords of the part's triangles", np.array(list(own.values()))))
    for form in ("shapes", "spline", "planes", "facets"):
        mine = [own[id(row)] for row in known if row["form"] == form]
        if mine:
            lines.append(tell(f"  {form}, {len(mine)} sites", np.array(mine)))
    real = [row for row in known if "truth" in row]
    if real:
        exact = np.array([(row["fine"] - row["chords"]) / row["truth"] - 1 for row in real])
        mesh = np.array([row["mesh"] / row["truth"] - 1 for row in real])
        lines.append(
            f"volume against the truth, whose skin is the part's triangles: exact, without chords, median "
            f"{np.median(np.abs(exact)):.3%}, mesh {np.median(np.abs(mesh)):.3%}"
        )
    return lines


def _count_reads(what: str, back: Sequence[dict[str, Any]]) -> list[str]:
    same = [abs(row["read_volume"] / row["volume"] - 1) < 1e-4 and row["read_valid"] for row in back]
    lines = [f"{what} read back by cadquery: {sum(same)} of {len(back)} with the same volume, valid"]
    other = [row for row in back if row["gmsh"]]
    same = [abs(row["gmsh"][0]) < 1e-4 and row["gmsh"][1] == row["read_solids"] for row in other]
    return [*lines, f"{what} read back by gmsh: {sum(same)} of {len(other)} with the same volume and number of solids"]


def _summarise_deposits(deposits: Sequence[dict[str, Any]]) -> list[str]:
    good = [deposit for deposit in deposits if not deposit["reason"]]
    if not good:
        return [f"{len(deposits)} deposits, none exact"]
    seconds, faces = (np.array([deposit[name] for deposit in good]) for name in ("seconds", "faces"))
    reasons = sorted(deposit["reason"] for deposit in deposits if deposit["reason"])
    return [
        f"{len(deposits)} deposits on exact damage volumes, exact {len(good) / len(deposits):.1%}; others: {reasons}",
        f"deposits: seconds median {np.median(seconds):.1f}, 95 % {np.quantile(seconds, 0.95):.1f}; "
        f"faces median {np.median(faces):g}",
        *_count_reads("deposit", good),
    ]


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main(sys.argv[1:])

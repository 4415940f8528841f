"""Parts that others made: a drawn loss on each file of a folder, and which stage takes long on which part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from statistics import median
from zlib import crc32

from damageest_evaluate.case import DamageCase
from damageest_evaluate.damages import KINDS
from damageest_evaluate.processes import Row

from damageest.artefacts import Part
from damageest.errors import DamageestError, describe_error

POINTS = 120_000
NOISE, TOLERANCE = 0.0004, 0.0015
"""As shares of the part's diagonal."""
SLOW, LEAST = 5.0, 3.0
"""A stage stands out from so many times its median, and so many seconds, on."""
SUFFIXES = (".step", ".stp", ".iges", ".igs", ".brep", ".stl", ".ply", ".obj", ".off")


@cache
def _read(path: str) -> Part:
    """The part in a file, as a job that names only the file reads it."""
    from damageest import read_part
    from damageest.job import load
    from damageest.registry import Registry

    registry = Registry.discover()
    return read_part(load({"version": 1, "units": "mm", "part": path, "scan": {"use": "simulate"}}, registry), registry)


@dataclass(frozen=True)
class FileCase(DamageCase):
    """A case on the part of ``file``, which is read as a part in mm. Noise and tolerance follow from its size."""

    def load_part(self) -> Part:
        """The part."""
        return _read(self.file)

    def run(self) -> Row:
        """As `run_case`; a file that is no part gives a row that says why."""
        try:
            part = self.load_part()
        except DamageestError as error:
            return self.make_blank_row() | {"error": describe_error(error), "skipped": True, "missed": 0}
        scanner = {**self.scanner, "noise": NOISE * part.diagonal}
        tolerance = float(f"{TOLERANCE * part.diagonal:.4g}")
        settings = (*self.settings, f"tolerance={tolerance}")
        row = DamageCase.run(replace(self, scanner=scanner, tolerance=tolerance, settings=settings))
        return row | {"key": self.compute_key(), "triangles": len(part.faces), "diagonal": part.diagonal}


def make_file_cases(folder: Path, seed: int, source: str) -> list[FileCase]:
    """A case for each file of the folder, in order of names. Its damage follows from name and seed alone."""
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    numbers = [crc32(path.name.encode()) % 1000 for path in files]
    scanner = {"points": POINTS, "noise": 0.0, "pose": "random"}
    return [
        FileCase(
            part=path.name, seed=1000 * seed + number, first=tuple(KINDS)[number % len(KINDS)], tolerance=0.0,
            scanner=scanner, source=source, file=str(path.resolve()),
        )
        for number, path in zip(numbers, files, strict=True)
    ]  # fmt: skip


def describe_file_row(row: Row) -> str:
    """A row in a line."""
    if row["error"]:
        return f"{row['part']}: {'not run: ' if row['skipped'] else ''}{row['error'][:200]}"
    return f"{row['part']}: IoU {row['iou']:.3f}, {row['sites']} sites, {row['seconds']:.0f} s"


def make_others_table(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body: for each part what came out, and the stages that took far longer than on the others."""
    done = [row for row in rows if not row["error"]]
    names = sorted({stage for row in done for stage in row["stage_seconds"]})
    usual = {name: median(row["stage_seconds"].get(name, 0.0) for row in done) for name in names}
    lines = [["part", "triangles", "damage", "sites", "IoU", "pose, tolerances", "s", "slow stages", "said"]]
    for row in rows:
        if row["skipped"] and not row.get("triangles"):
            lines.append([row["part"], "", "", "", "", "", "", "", f"no part: {_shorten(row['error'])}"])
            continue
        stages = row.get("stage_seconds", {}).items()
        slow = [f"{name} {took:.0f} s" for name, took in stages if took > max(SLOW * usual[name], LEAST)]
        off = row.get("pose_error")
        pose = "" if off is None else f"{off / row['tolerance']:.2f}"
        came = ["", "", pose, f"{row['seconds']:.0f}"] if row["error"] else [
            str(row["sites"]), f"{row['iou']:.3f}", pose, f"{row['seconds']:.0f}",
        ]  # fmt: skip
        said = _shorten(row["error"]) or ", ".join(sorted(set(row["reasons"]))[:4])
        lines.append(
            [row["part"], str(row.get("triangles", "")), ", ".join(row["kinds"]), *came, ", ".join(slow), said]
        )
    return lines


def _shorten(text: str) -> str:
    return text.replace("|", "/")[:120]

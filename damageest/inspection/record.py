"""The record of a repair: one JSON file, `record.json`, that grows with each step.

Its parts follow the order of work of repair by directed energy deposition, as ASTM F3187 guides it: the workpiece, its
inspection before, the deposition as it was planned, and the inspections after each step. Each entry has the digest of
the one before it, and the file that of its content, as result.json has.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest.inspection.aim import Aim
from damageest.inspection.compare import Inspection
from damageest.io.files import file_sha256, read_json

NAME, PAGE = "record.json", "record.html"
VERSION = 1


def begin_record(aim: Aim) -> dict[str, Any]:
    """The record of a repair before its first step: workpiece, inspection before, and the deposition as planned."""
    content = aim.folder.content
    job = content["provenance"]["job"]
    sites = [
        {
            "site": site["id"],
            "verdict": site["verdict"]["level"],
            "repaired": site["id"] in aim.deposits,
            "volume": site["volume"],
            "cut_back_in_it": _find_cut_back(aim, site),
            "volume_95": site["volume_95"],
            "depth": site["max_depth"],
        }
        for site in content["sites"]
    ]
    deposits = [
        {
            "site": site["id"],
            "deposit_volume": (site.get("deposit") or {}).get("volume", site["volume"]),
            "stock_volume": (site.get("deposit") or {}).get("stock_volume", 0.0),
            "stock_thickness": (site.get("deposit") or {}).get("thickness"),
            "path": site.get("path"),
        }
        for site in content["sites"]
        if site["id"] in aim.deposits
    ]
    return {
        "schema": VERSION,
        "name": content["name"],
        "units": content["units"],
        "workpiece": {"part": content["part"], "result_sha256": content["provenance"]["sha256"]},
        "inspection_before": {
            "scans": [item for item in content["provenance"]["inputs"] if item["path"] in content["scan"]["paths"]],
            "tolerance": content["tolerance"],
            "pose": {key: content["alignment"][key] for key in ("transform", "rms", "datums", "held")},
            "damage_volume": content["damage_volume"],
            "lost_volume": max(content["damage_volume"] - sum(one["cut_back_in_it"] for one in sites), 0.0),
            "volume_95": content["volume_95"],
            "sites": sites,
            "versions": content["versions"],
        },
        "deposition": {
            "allowance": job.get("allowance"),
            "path_parameters": job.get("path"),
            "material": content["material"],
            "sites": deposits,
        },
        "inspections": [],
        "sha256": "",
    }


def _find_cut_back(aim: Aim, site: Mapping[str, Any]) -> float:
    """Volume of intact metal in a site's damage volume: of the cut-back, where that enlarged it. What is milled off by
    `prepare` is in a solid of its own."""
    cut = float((site.get("deposit") or {}).get("cut_back_volume") or 0.0)
    return cut if site["accepted"] and cut and aim.folder.read_solid("milled", site["id"]) is None else 0.0


def describe_inspection(aim: Aim, found: Inspection, scan: Path, time: datetime, previous: str) -> dict[str, Any]:
    """An entry of the record. ``previous``: the digest of the entry before it, or of the result."""
    entry = {
        "step": aim.step,
        "time": time.astimezone(UTC).isoformat(timespec="seconds"),
        "scan": {"name": scan.name, "bytes": scan.stat().st_size, "sha256": file_sha256(scan),
                 "points": len(found.result.scan.points)},
        "pose": {"by": found.pose, "transform": found.result.pose.T_part_scan.tolist(),
                 "rms_on_unrepaired": found.off if math.isfinite(found.off) else None},
        "tolerance": found.tolerance,
        "defect": found.defect,
        "whole": vars(found.whole),
        "findings": [vars(one) for one in found.findings],
        "verdicts": [vars(one) for one in found.verdicts],
        "notes": list(found.notes),
        "damageest": version("damageest"),
        "previous": previous,
    }  # fmt: skip
    plain: dict[str, Any] = json.loads(json.dumps(entry))
    return {**plain, "sha256": hash_content(plain)}


def hash_content(content: Mapping[str, Any]) -> str:
    """SHA-256 of a record or of an entry, without the one that it holds itself."""
    bare = {key: value for key, value in content.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(bare, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def read_record(path: Path, aim: Aim | None = None) -> dict[str, Any]:
    """A record from its file. ``aim``: the repair that it has to be of.

    Raises InputError where it cannot be read, was changed, or is of another result.
    """
    try:
        record: dict[str, Any] = read_json(path)
        entries = record["inspections"]
        previous = record["workpiece"]["result_sha256"]
        for number, entry in enumerate(entries, 1):
            if entry["sha256"] != hash_content(entry) or entry["previous"] != previous:
                raise InputError(
                    f"{path}: entry {number} was changed after it was written, or one before it is missing"
                )
            previous = entry["sha256"]
        sealed = record["sha256"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: cannot be read as a record: {error}") from None
    if sealed != hash_content(record):
        raise InputError(f"{path}: was changed after it was written")
    if aim is not None and record["workpiece"]["result_sha256"] != aim.folder.content["provenance"]["sha256"]:
        raise InputError(
            f"{path}: belongs to an earlier result of this job; rename it, and inspect again to start a new record"
        )
    return record


def append_inspection(aim: Aim, found: Inspection, scan: Path, time: datetime | None = None) -> dict[str, Any]:
    """Adds an inspection to the record in the output folder, and begins that where there is none. Gives the record.

    ``time``: None: now. Raises InputError as `read_record` does.
    """
    path = aim.folder.folder / NAME
    record = read_record(path, aim) if path.is_file() else begin_record(aim)
    entries = record["inspections"]
    previous = entries[-1]["sha256"] if entries else record["workpiece"]["result_sha256"]
    entries.append(describe_inspection(aim, found, scan, time or datetime.now(UTC), previous))
    record = dict(json.loads(json.dumps(record)))
    record["sha256"] = hash_content(record)
    text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    aside = path.with_suffix(".json.new")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)
    return record

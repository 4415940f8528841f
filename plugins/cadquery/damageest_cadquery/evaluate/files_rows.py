"""Rows of the measurement on CAD files of others: what is not as it should be in each, and figures over all."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

SAME = 0.003
"""Largest relative difference between a volume read back and that of the mesh."""


def read_rows(output: Path) -> list[dict[str, Any]]:
    """The rows of a file, none where there is no such file; of several rows for one CAD file the last."""
    if not output.exists():
        return []
    rows = [json.loads(line) for line in output.read_text().splitlines()]
    return list({row["file"]: row for row in rows}.values())


def find_faults(read: dict[str, Any]) -> list[str]:
    """What is wrong in a file that was read back."""
    if "fault" in read:
        return [read["fault"]]
    faults = []
    if read["solids"] != read["written_solids"]:
        faults.append(f"{read['solids']} solids for {read['written_solids']}")
    if read["faces"] != read["written_faces"]:
        faults.append(f"{read['faces']} faces for {read['written_faces']}")
    if not read["valid"]:
        faults.append("not valid")
    if not measure_off(read) <= SAME:
        faults.append(f"volume {measure_off(read):.2%} from the mesh")
    if read["unnamed"]:
        faults.append(f"{read['unnamed']} faces without a name")
    if read["without_colour"]:
        faults.append(f"{read['without_colour']} faces without a colour")
    return faults


def measure_off(read: dict[str, Any]) -> float:
    """The relative difference between the volume read back and the mesh's."""
    if not np.isfinite(read["mesh"]):
        return float("nan")
    found = [read["volume"], *([] if read["by_triangles"] is None else [read["by_triangles"]])]
    return float(min(abs(volume / read["mesh"] - 1) for volume in found))


def measure_outline(row: dict[str, Any], site: dict[str, Any]) -> float:
    """The share of a deposit by which it is larger than the mesh's because its outline is: stock stands on all skin
    that the exact damage volume takes."""
    return float(row["stock"] * (site["damage"]["skin"] - site["skin"]) / site["deposit"]["mesh"])


def summarise_files(rows: Sequence[dict[str, Any]]) -> str:
    """The figures over all files, in words, and each that is not as wanted by its name."""
    lost = Counter(row["kind"] for row in rows if "error" in row)
    sites = [(row, site) for row in rows for site in row.get("sites", [])]
    measured = len(rows) - sum(lost.values())
    lines = [f"{len(rows)} files, {measured} measured, {len(sites)} damages; not measured: {dict(lost)}"]
    for what in ("damage", "deposit"):
        mine = [(row, site) for row, site in sites if what in site]
        faults = [(row, site, find_faults(site[what])) for row, site in mine]
        bad = [each for each in faults if each[2]]
        good = len(mine) - len(bad)
        lines.append(f"{what}: exact form on {len(mine)} of {len(sites)}, {good} of them read back without a fault")
        for row, site, told in bad:
            known = what == "deposit" and "skin" in site and "stock" in row and "mesh" in site["deposit"]
            why = f"; the outline explains {measure_outline(row, site):+.2%}" if known else ""
            lines.append(f"  {row['file']}, {what}: {', '.join(told)}{why}")
    for row, site in sites:
        exact = site["exact"]
        if exact["form"] == "none":
            lines.append(f"  {row['file']}, damage: {exact['tried'][-1] if exact['tried'] else 'unknown'}")
        elif exact.get("deposit") and exact["deposit"]["reason"]:
            lines.append(f"  {row['file']}, deposit: {exact['deposit']['reason']}")
        elif "no_deposit" in site:
            lines.append(f"  {row['file']}, no deposit: {site['no_deposit']}")
    lines += [f"  {row['file']}, {row['kind']}: {row['error']}" for row in rows if "error" in row]
    return "\n".join(lines)

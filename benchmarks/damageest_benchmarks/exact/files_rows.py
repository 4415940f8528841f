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
    """The difference between the volume read back and the mesh's, as a share of the latter; of metal to mill off, of
    the cavity that it opens."""
    if not np.isfinite(read["mesh"]):
        return float("nan")
    found = [read["volume"], *([] if read["by_triangles"] is None else [read["by_triangles"]])]
    return float(min(abs(volume - read["mesh"]) for volume in found) / read.get("of", read["mesh"]))


def measure_fairly(site: dict[str, Any], what: str) -> float | None:
    """The relative difference of a damage volume from the mesh without what the chords of the part's triangles do, or
    of a deposit from the stage's stock on the exact damage volume's own skin; None where that was not measured."""
    read = site[what]
    if what == "damage":
        return None if "chords" not in read else float((read["fine"] - read["chords"]) / read["mesh"] - 1)
    if "on_own_skin" not in read or read.get("by_triangles") is None:
        return None
    return float(read["by_triangles"] / read["on_own_skin"] - 1)


def count_fair(sites: Sequence[dict[str, Any]]) -> list[str]:
    """In words, how many of the sites are within `SAME` of the mesh and of the fairer references; and how many damage
    volumes are nearer to the true damage than the mesh."""
    lines = []
    for what, how in (("damage", "without chords"), ("deposit", "from stock on its own skin")):
        mine = [site for site in sites if "volume" in site.get(what, {})]
        raw = sum(measure_off(site[what]) <= SAME for site in mine)
        fair = [abs(value) for site in mine if (value := measure_fairly(site, what)) is not None]
        text = f"{what}: within {SAME:.1%} of the mesh {raw} of {len(mine)}"
        if fair:
            text += (
                f"; {how} {sum(value <= SAME for value in fair)} of {len(fair)}, "
                f"median {np.median(fair):.3%}, most {max(fair):.3%}"
            )
        lines.append(text)
    both = [(site["damage"]["iou_exact"], site["damage"]["iou_mesh"]) for site in sites if "truth" in site["damage"]]
    if both:
        exact, mesh = np.array(both).T
        lines.append(
            f"IoU with the true damage: exact median {np.median(exact):.4f}, mesh {np.median(mesh):.4f}; "
            f"exact at least as near on {(exact >= mesh).sum()} of {len(both)}"
        )
    return lines


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
    for what in ("damage", "deposit", "milled"):
        mine = [(row, site) for row, site in sites if what in site]
        if what == "milled" and not any(site["exact"].get("milled") for _, site in sites):
            continue
        faults = [(row, site, find_faults(site[what])) for row, site in mine]
        bad = [each for each in faults if each[2]]
        good = len(mine) - len(bad)
        lines.append(f"{what}: exact form on {len(mine)} of {len(sites)}, {good} of them read back without a fault")
        for row, site, told in bad:
            known = what == "deposit" and "skin" in site and "stock" in row and "mesh" in site["deposit"]
            why = f"; the outline explains {measure_outline(row, site):+.2%}" if known else ""
            lines.append(f"  {row['file']}, {what}: {', '.join(told)}{why}")
    lines += count_fair([site for _, site in sites if "damage" in site])
    for row, site in sites:
        exact = site["exact"]
        if exact["form"] == "none":
            lines.append(f"  {row['file']}, damage: {exact['tried'][-1] if exact['tried'] else 'unknown'}")
        elif exact.get("deposit") and exact["deposit"]["reason"]:
            lines.append(f"  {row['file']}, deposit: {exact['deposit']['reason']}")
        if exact.get("milled") and exact["milled"]["reason"]:
            lines.append(f"  {row['file']}, milled: {exact['milled']['reason']}")
        if "no_deposit" in site:
            lines.append(f"  {row['file']}, no deposit: {site['no_deposit']}")
    lines += [f"  {row['file']}, {row['kind']}: {row['error']}" for row in rows if "error" in row]
    return "\n".join(lines)

"""Makes docs/gallery.md from real runs: `uv run python docs/pictures/make_gallery.py`.

It runs ten jobs of the repository, draws what each wrote into docs/images/gallery, and writes the page between its
marks: the job's own comment, the command, the time, and the verdicts. A name, or several, makes these anew and
keeps the rest; `--draw` draws what earlier runs left in jobs/out/gallery.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import panels
import pyvista as pv

from damageest.findings import describe_interval
from damageest.io import colours
from damageest.output.folder import OutputFolder, open_output

ROOT = Path(__file__).parents[2]
IMAGES, PAGE = ROOT / "docs" / "images" / "gallery", ROOT / "docs" / "gallery.md"
SIZE = (760, 285)
PALETTE = 128
"""Colours of a picture: fewer make a smaller file."""
BEGIN, END = "<!-- gallery: begin -->\n", "<!-- gallery: end -->"


@dataclass(frozen=True)
class Case:
    """A job of the repository, its heading, and what its two pictures show. ``is_wide``: the first one shows all that
    was scanned, and not only the part."""

    job: str
    title: str
    looks: tuple[Literal["points", "deviation"], Literal["damage", "deposit"]] = ("points", "damage")
    is_wide: bool = False

    @property
    def name(self) -> str:
        return Path(self.job).stem


CASES = (
    Case("jobs/block_wedge.yaml", "A wedge broken off a milled block"),
    Case("jobs/gear_teeth.yaml", "A gear with broken teeth"),
    Case("jobs/bent_blade.yaml", "A bent blade with two chips"),
    Case("jobs/half_torus.yaml", "Half a ring, damaged inside"),
    Case("jobs/four_sites.yaml", "A plate with four damages"),
    Case("jobs/cylinder_two_sides.yaml", "A cylinder that fits in any turn"),
    Case("jobs/worn_shaft.yaml", "A seat worn on one side", ("deviation", "damage")),
    Case("jobs/worn_bore.yaml", "A worn bore, with stock to bore it out", ("points", "deposit")),
    Case("jobs/bad_scans/table.yaml", "The table and a clamp in the scan", is_wide=True),
    Case("jobs/bad_scans/holes.yaml", "A deep hole, scanned from one side"),
)


@dataclass(frozen=True)
class Entry:
    """What a run gave: the comment of the job, processor seconds, sites and values as text."""

    about: str
    seconds: float
    megabytes: float
    sites: tuple[str, ...]
    total: str
    truth: str


def run(case: Case, folder: Path) -> tuple[OutputFolder, float, float]:
    """The output folder of a job, run anew by the command that the page shows; processor seconds and peak MB."""
    code = "from damageest.cli import main; main()"
    command = [sys.executable, "-c", code, "run", case.job, "--no-cache", "-q", "-o", str(folder)]
    started = subprocess.Popen(command, cwd=ROOT)
    used = os.wait4(started.pid, 0)[2]  # with all processes that it waited for
    return open_output(folder), used.ru_utime + used.ru_stime, used.ru_maxrss / 1000


def describe(case: Case, folder: OutputFolder, seconds: float, megabytes: float) -> Entry:
    content = folder.content
    comments = [line[1:].strip() for line in (ROOT / case.job).read_text().splitlines() if line.startswith("#")]
    about = " ".join(line for line in comments if not line.startswith("yaml-language-server"))
    unit = f"{content['units']}³"
    sites = []
    for site in content["sites"]:
        verdict = site["verdict"]
        codes = ", ".join(f"`{reason['code']}`" for reason in verdict["reasons"])
        depth = f"{site['max_depth']:.2g} {content['units']} deep"
        said = f"**{verdict['level']}**" + (f" ({codes})" if codes and verdict["level"] != "proven" else "")
        sites.append(f"{site['volume']:.5g} {unit}, {depth}: {said}")
    interval = content["volume_95"]
    known = "" if interval is None else f" (95 %: {describe_interval((interval[0], interval[1] or float('inf')))})"
    truth = content.get("truth") or {}
    true = f"{truth['volume']:.5g} {unit}, IoU {truth['iou']:.3f}" if truth.get("iou") is not None else ""
    cut_back = sum((site["deposit"] or {}).get("cut_back_volume") or 0 for site in content["sites"])
    known += f", with {cut_back:.5g} {unit} of worn metal that is cut back" if cut_back else ""
    true += ", before that" if cut_back and true else ""
    known += "" if all(site["accepted"] for site in content["sites"]) else "; a doubtful site is no part of it"
    volume = content["damage_volume"]
    return Entry(about, seconds, megabytes, tuple(sites), f"{volume:.5g} {unit}{known}", true)


def draw(case: Case, folder: OutputFolder) -> None:
    """Two pictures side by side: what was scanned, and what is missing."""
    scan, left = folder.scan, folder.read_solid("undamaged") or folder.read_mesh("skin.ply")
    assert scan is not None
    assert left is not None
    surfaces = [mesh for number in folder.site_numbers if (mesh := folder.read_surface(number)) is not None]
    way = panels.choose_way(left, surfaces)
    plotter = panels.open_panels(2, SIZE)
    for column, look in enumerate(case.looks):
        plotter.subplot(0, column)
        if look in ("points", "deviation"):
            limit = 3 * float(folder.content["tolerance"])
            by_distance = panels.colour_distances(scan.distance, limit)
            colour = by_distance if look == "deviation" else panels.colour_sites(scan.site)
            if look == "points":
                colour[(np.abs(scan.distance) > limit) & (scan.site == 0)] = pv.Color(colours.SURPLUS).float_rgb
            panels.add_scan(plotter, scan.points, colour, left, way)
        else:
            plotter.enable_depth_peeling(8)
            panels.add_body(plotter, left, panels.LEFT, 0.5 if look == "damage" else 1.0)
            for number in folder.site_numbers:
                body = folder.read_solid(look, number) or folder.read_solid("damage", number)
                if body is not None:
                    shown = colours.DEPOSIT if look == "deposit" else colours.colour_site(number)
                    panels.add_body(plotter, body, shown, edges=False)
        is_wide = case.is_wide and column == 0
        panels.look_at(plotter, scan.points if is_wide else left.vertices, way)
    panels.save(plotter, IMAGES / f"{case.name}.png", SIZE, PALETTE)


def write(case: Case, entry: Entry) -> str:
    """The section of a case."""
    word = {"points": "the scan, each site in a colour", "deviation": "the scan by its distance to the skin"}
    right = {"damage": "the damage volumes in the remaining part", "deposit": "the deposit on the remaining part"}
    alt = f"{word[case.looks[0]]}; {right[case.looks[1]]}"
    lines = [
        f"## {case.title}",
        "",
        entry.about,
        "",
        f"![{alt[0].upper()}{alt[1:]}](images/gallery/{case.name}.png)",
        "",
    ]
    lines += ["```sh", f"damageest run {case.job}", "```", "", "| | |", "| --- | --- |"]
    lines += [f"| site {number} | {text} |" for number, text in enumerate(entry.sites, 1)]
    lines += [f"| damage volume | {entry.total} |"]
    lines += [f"| true | {entry.truth} |"] if entry.truth else []
    lines += [f"| processor time, peak memory | {entry.seconds:.0f} s, {entry.megabytes:.0f} MB |", ""]
    return "\n".join(lines)


def main(words: list[str]) -> None:
    chosen, only_draw = [word for word in words if word != "--draw"], "--draw" in words
    kept = IMAGES / "gallery.json"
    entries = json.loads(kept.read_text()) if kept.is_file() else {}
    for case in CASES:
        if chosen and case.name not in chosen:
            continue
        output = ROOT / "jobs" / "out" / "gallery" / case.name
        if only_draw:
            known = entries[case.name]
            folder, seconds, megabytes = open_output(output), known["seconds"], known["megabytes"]
        else:
            folder, seconds, megabytes = run(case, output)
        entries[case.name] = asdict(describe(case, folder, seconds, megabytes))
        draw(case, folder)
        ordered = {one.name: entries[one.name] for one in CASES if one.name in entries}
        kept.write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    sections = "\n".join(write(case, Entry(**entries[case.name])) for case in CASES if case.name in entries)
    head, tail = text.partition(BEGIN)[0], text.partition(END)[2]
    PAGE.write_text(f"{head}{BEGIN}{sections}{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

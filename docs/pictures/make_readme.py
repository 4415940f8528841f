"""Makes what the README shows from real runs: `uv run python docs/pictures/make_readme.py`.

docs/images/in-and-out.png: the part as designed, its scan by distance, what is missing. docs/images/run.svg: a run in
the terminal. docs/images/badge-*.svg: licence, Pythons and types, as pyproject.toml has them. A word, `picture`, `run`
or `badges`, makes one of them.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import panels
from rich._export_format import CONSOLE_SVG_FORMAT
from rich.console import Console
from rich.text import Text

import damageest
from damageest.io import colours
from damageest.output.folder import open_output

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images"
JOB = "jobs/gear_teeth.yaml"
SIZE = (900, 300)
PALETTE = 200
WAY = (-0.75, -1.0, 1.1)
"""From where the three panels are seen."""
COLUMNS = 112
BADGE = """<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="20" role="img" aria-label="{left}: {right}">
<rect width="{width}" height="20" rx="3" fill="#4b555c"/>
<path d="M{split} 0h{rest}a3 3 0 0 1 3 3v14a3 3 0 0 1-3 3h-{rest}z" fill="{colour}"/>
<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">
<text x="7" y="14">{left}</text><text x="{at}" y="14">{right}</text></g></svg>
"""


def draw_picture() -> None:
    """What goes in and what comes out, side by side."""
    folder = ROOT / "jobs" / "out" / "readme"
    result = damageest.run(ROOT / JOB, output=folder)
    scan, left = open_output(folder).scan, result.undamaged
    assert scan is not None
    assert left is not None
    plotter = panels.open_panels(3, SIZE)
    for column, title in enumerate(("the part as designed", "its scan, by distance", "what is missing")):
        plotter.subplot(0, column)
        if column == 0:
            panels.add_body(plotter, result.part, panels.LEFT)
        elif column == 1:
            colour = panels.colour_distances(scan.distance, 3 * result.tolerance)
            panels.add_scan(plotter, scan.points, colour, left, np.array(WAY))
        else:
            plotter.enable_depth_peeling(8)
            panels.add_body(plotter, left, panels.LEFT, 0.4)
            for site in result.sites:
                panels.add_body(plotter, site.damage, colours.colour_site(site.id), edges=False)
        plotter.add_text(title, position=(12, 6), font_size=9, color="black")
        panels.look_at(plotter, result.part.vertices, np.array(WAY), 0.9)
    panels.save(plotter, IMAGES / "in-and-out.png", SIZE, PALETTE)


def record_run() -> None:
    """The example job in a terminal of its own, as a drawing without fonts from elsewhere."""
    command = ["damageest", "run", "jobs/block_wedge.yaml"]
    code = "import sys; sys.argv[0] = 'damageest'; from damageest.cli import main; main()"
    environment = {**os.environ, "COLUMNS": str(COLUMNS)}  # a pipe: a line for each stage, none is drawn again
    done = subprocess.run(
        [sys.executable, "-c", code, *command[1:], "--no-cache"],
        cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True,
    )  # fmt: skip
    console = Console(record=True, width=COLUMNS, file=open(os.devnull, "w"), force_terminal=True)  # noqa: SIM115
    console.print(Text("$ " + " ".join(command), style="bold"))
    said = done.stdout.replace(f"{ROOT}/", "~/damageest/")
    text = Text(said)
    text.highlight_regex(r"(?m)^site  volume.*$", "bold")
    text.highlight_regex(r"\bproven\b", "green")
    text.highlight_regex(r"(?m)^note:", "yellow")
    console.print(text)
    plain = re.sub(r"@font-face\s*\{\{.*?\}\}", "", CONSOLE_SVG_FORMAT, flags=re.DOTALL)
    path = IMAGES / "run.svg"
    drawn = console.export_svg(title="damageest", code_format=plain, unique_id="run")
    path.write_text(drawn.replace("Fira Code", "DejaVu Sans Mono, Consolas"), encoding="utf-8")
    print(f"{path.name}: {path.stat().st_size // 1000} kB")


def draw_badges() -> None:
    for name, text in make_badges().items():
        (IMAGES / f"badge-{name}.svg").write_text(text, encoding="utf-8")


def make_badges() -> dict[str, str]:
    """The badges by name: what pyproject.toml says of licence, Pythons and types."""
    told = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    licence = told["project"]["license"]
    python = told["project"]["requires-python"].replace(">=", "≥ ")
    types = "mypy strict" if told["tool"]["mypy"]["strict"] else "mypy"
    words = {"licence": ("licence", licence, "#2f6f9f"), "python": ("Python", python, "#2f6f9f"),
             "types": ("types", types, "#1f7a4d")}  # fmt: skip
    return {name: _make_badge(*each) for name, each in words.items()}


def _make_badge(left: str, right: str, colour: str) -> str:
    split, rest = round(14 + 6.6 * len(left)), round(14 + 6.6 * len(right))
    return BADGE.format(
        width=split + rest, split=split, rest=rest - 3, at=split + 7, left=left, right=right, colour=colour
    )


if __name__ == "__main__":
    made = {"picture": draw_picture, "run": record_run, "badges": draw_badges}
    for chosen in sys.argv[1:] or made:
        made[chosen]()

"""Columns of numbers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tests.io.writers.base import Draw, Rng, Written

WORDS = ["Scanner: Ä", "Date: 2026-03-05", "Project 17", "Operator: Å. Ö.", "exported by a program"]


def write_text(rng: Rng) -> Written:
    draw = Draw(rng)
    points = draw.points()
    count = len(points)
    mark = draw.one("between", " ", "  ", "\t", ",", ", ", ";", "; ", " \t ")
    comma = draw.maybe("decimal comma", 0.3)
    form = draw.one("numbers", "{:.4f}", "{:.4f}", "{:.9e}", "{:.9E}", "fortran", "{:+.4f}", "{:12.4f}", "{:.17g}")
    suffix = draw.one("suffix", ".txt", ".xyz", ".asc", ".csv", ".pts")
    before, normals, names = draw.one("before", "nothing", "nothing", "number", "normals"), None, [*"xyz"]
    table = points
    if before == "number":
        table, names = np.column_stack([np.arange(count) + draw.one("first", 0, 1, 1000), table]), ["id", *names]
    if before == "normals":
        normals = draw.normals(count)
        table, names = np.column_stack([normals, table]), ["nx", "ny", "nz", *names]
    after = draw.one("after", "nothing", "nothing", "intensity", "colour", "normals")
    if after == "intensity":
        table, names = np.column_stack([table, rng.integers(-2000, 2000, count)]), [*names, "intensity"]
    if after == "colour":
        table, names = np.column_stack([table, rng.integers(0, 256, (count, 3))]), [*names, *"rgb"]
    if after == "normals" and normals is None:
        normals = draw.normals(count)
        table, names = np.column_stack([table, normals]), [*names, "nx", "ny", "nz"]

    def show(value: float) -> str:
        shown = f"{value:.9E}".replace("E", "D") if form == "fortran" else form.format(value)
        return shown.replace(".", ",") if comma else shown

    lines = [mark.join(map(show, row)) for row in table]
    if mark.strip() and draw.maybe("separator at the end", 0.2):
        lines = [line + mark.strip() for line in lines]
    if form not in ("{:12.4f}", "fortran") and draw.maybe("quotes", 0.1):
        lines = [mark.join(f'"{show(value)}"' for value in row) for row in table]
    elif draw.maybe("space in front", 0.2):
        lines = ["   " + line for line in lines]
    if draw.maybe("blank lines", 0.2):
        lines = [*lines[:7], "", *lines[7:], "", "  "]
    if draw.maybe("comments between", 0.2):
        lines = [*lines[:3], "# a comment", *lines[3:]]
    head = draw.one(
        "head", "none", "count", "words", "names", "names", "# names", "// names", "# words", "words, count"
    )
    lines = [*_head(draw, head, names, mark, count), *lines]
    end = draw.one("end of line", "\n", "\n", "\r\n", "\r")
    text = end.join(lines) + draw.one("last", end, "")
    code = draw.one("code", "utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1")
    both = comma and mark.strip() == "," and not draw.ways.get("quotes")
    return Written(
        {suffix: text.encode(code)}, points, draw.ways, refused="comma separates columns" if both else "",
        normals=normals, error=1e-6,
    )  # fmt: skip


def _head(draw: Draw, head: str, names: list[str], mark: str, count: int) -> list[str]:
    if head == "none":
        return []
    if head == "count":
        return [str(count)]
    if head in ("words", "words, count"):
        return [*WORDS[: draw.one("lines", 1, 3, 5)], *([str(count)] if "count" in head else [])]
    if head == "# words":
        return ["# " + word for word in WORDS]
    style = draw.one("style", str, str.upper, lambda name: f"{name} [mm]", lambda name: f'"{name}"')
    draw.ways["style"] = style("x")
    if head == "names":
        return [(mark if mark.strip() or "\t" in mark or " [" not in style("x") else "\t").join(map(style, names))]
    lead = "#" if head == "# names" else "//"
    return [
        lead + draw.one("space", "", " ") + (mark.strip() or " ").join(style(name).replace(" ", "") for name in names)
    ]


def write_pts(rng: Rng) -> Written:
    """Scans one after the other, each with its count."""
    draw = Draw(rng)
    points = draw.points(60)
    width = draw.one("columns", 3, 4, 7)
    rest = np.column_stack([rng.integers(-2048, 2048, 60), rng.integers(0, 256, (60, 3))])[:, : width - 3]
    ends = sorted({0, 60, *rng.integers(1, 60, draw.one("scans", 0, 1, 4)).tolist()})
    lines = []
    for first, last in pairwise(ends):
        lines.append(draw.one("count", "{}", "{} ", " {}").format(last - first))
        lines += ["{:.4f} {:.4f} {:.4f}".format(*p) + "".join(f" {r}" for r in more)
                  for p, more in zip(points[first:last], rest[first:last], strict=True)]  # fmt: skip
    text = draw.one("end of line", "\n", "\r\n").join(lines) + "\n"
    return Written({".pts": text.encode()}, points, draw.ways)


def write_ptx(rng: Rng) -> Written:
    draw = Draw(rng)
    blocks, placed = [], []
    width = draw.one("columns", 4, 7)
    number = draw.one("numbers", "{:.6f}", "{:g}", "{:.8e}")
    for _ in range(draw.one("scans", 1, 2, 3)):
        columns, rows = draw.one("shape", (4, 10), (10, 4), (1, 40))
        points = rng.uniform(-3, 3, (40, 3)).round(4)
        points[rng.random(40) < 0.2] = 0
        turn, place = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.uniform(-5, 5, 3)
        turn *= np.sign(np.linalg.det(turn))
        lines = [str(columns), str(rows), *(" ".join(f"{v:.9f}" for v in row) for row in (place, *turn))]
        lines += [" ".join(f"{v:.9f}" for v in (*row, 0)) for row in turn]
        lines.append(" ".join(f"{v:.9f}" for v in (*place, 1)))
        for point in points:
            lines.append(" ".join([number.format(v) for v in point] + ["0.5", "10", "200", "30"][: width - 3]))
        blocks.append(lines)
        kept = points[points.any(axis=1)]
        placed.append(np.array([turn.T @ point + place for point in kept]))
    text = draw.one("end of line", "\n", "\r\n").join(line for lines in blocks for line in lines) + draw.one(
        "last", "\n", ""
    )
    return Written({".ptx": text.encode()}, np.vstack(placed), draw.ways, error=2e-4)

"""The report as a PDF to be signed: one page of summary, the sections, a page for each site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from reportlab.lib.pagesizes import A4
from reportlab.lib.units import mm
from reportlab.lib.utils import ImageReader
from reportlab.platypus import BaseDocTemplate, Frame, KeepTogether, PageBreak, PageTemplate, Spacer, Table

from damageest.artefacts import Mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.views import View
from damageest.io import colours
from damageest.result import Result, Site
from damageest.rules.notes import merge_notes
from damageest.stages.report._drawing import draw
from damageest.stages.report._page import choose_tone, list_volumes
from damageest.stages.report._section import lay_out_site
from damageest.stages.report._sites import Remains, Shown
from damageest.stages.report._thin import thin_mesh
from damageest.stages.report.pdf._budget import show_budget
from damageest.stages.report.pdf._sections import show_sections
from damageest.stages.report.pdf.book import Book, clean_line
from damageest.stages.report.pdf.page_parts import (
    FOOT,
    HEAD,
    LEVELS,
    LINE,
    MARGIN,
    SOFT,
    WIDTH,
    Pages,
    Plot,
    grid_table,
    head,
    pair_table,
    picture,
    register_fonts,
    style,
    write,
)

MOST_ROWS = 12
"""Sites in the summary; all have a page."""
MOST_NOTES = 6
"""Notes of a run in the summary."""
TRIANGLES = 60_000
"""Triangles of the picture of the whole part."""


def write_pdf(path: Path, book: Book, sites: Sequence[Shown], remains: Remains, direction: Any) -> None:
    """Writes the PDF. The same result gives the same bytes: there is no date but those that are signed.

    ``sites``: as the page shows them; ``direction`` (3,): from which the part is looked at. Raises OSError where the
    logo cannot be read.
    """
    register_fonts()
    result = book.result
    story: list[Any] = [*_summarise(book, _draw_part(result, remains, direction))]
    if result.sections:
        story += [PageBreak(), *show_sections(book)]
    if result.budget is not None and len(result.sites) > 1:
        story += [PageBreak(), *show_budget(book, result.budget, book.words.tell("damage volume"), f"{book.unit}³")]
    for site, shown in zip(result.sites, sites, strict=True):
        story += [PageBreak(), *_show_site(book, site, shown)]
    numbered = book.words.tell("page {page} of {pages}")
    canvas = type("NumberedPages", (Pages,), {"number_text": numbered})
    document = BaseDocTemplate(
        str(path), pagesize=A4, leftMargin=MARGIN, rightMargin=MARGIN, topMargin=HEAD, bottomMargin=FOOT,
        title=f"{book.words.tell('Damage report')}: {result.name}", author=book.letterhead.company or "damageest",
        creator=f"damageest {book.content['versions']['damageest']}", invariant=1,
    )  # fmt: skip
    frame = Frame(MARGIN, FOOT, WIDTH, A4[1] - HEAD - FOOT, 0, 0, 0, 0)
    document.addPageTemplates(PageTemplate("page", [frame], onPage=lambda pen, _: _draw_head(pen, book)))
    document.build(story, canvasmaker=canvas)


def _draw_head(pen: Any, book: Book) -> None:
    """Company, logo and title at the head of a page, the job at its foot."""
    top = A4[1] - 10 * mm
    pen.saveState()
    left = MARGIN
    if book.letterhead.logo is not None:
        image = ImageReader(BytesIO(book.letterhead.logo.read_bytes()))
        width, height = image.getSize()
        scale = min(12 * mm / height, 50 * mm / width)
        pen.drawImage(image, MARGIN, top - scale * height + 2 * mm, scale * width, scale * height, mask="auto")
        left += scale * width + 4 * mm
    pen.setFont("VeraBd", 10)
    pen.drawString(left, top - 6 * mm, clean_line(book.letterhead.company))
    pen.setFont("Vera", 9)
    pen.setFillColor(SOFT)
    pen.drawRightString(A4[0] - MARGIN, top - 6 * mm, clean_line(book.words.tell("Damage report")))
    pen.setStrokeColor(LINE)
    pen.line(MARGIN, top - 11 * mm, A4[0] - MARGIN, top - 11 * mm)
    pen.setFont("Vera", 7)
    pen.drawString(
        MARGIN, 10 * mm, clean_line(f"{book.result.name}  ·  damageest {book.content['versions']['damageest']}")
    )
    pen.restoreState()


def _summarise(book: Book, image: bytes) -> list[Any]:
    result, content, tell, number = book.result, book.content, book.words.tell, book.words.number
    cubic = f"{book.unit}³"
    facts = [
        (tell("part"), Path(content["part"]["path"]).name or tell("given as arrays")),
        (tell("scan"), _name_scans(book)),
        (tell("damage volume"), f"{number(result.damage_volume)} {cubic}"),
        (tell("95 % interval"), book.interval(result.volume_95, cubic)),
        *((tell(name), f"{number(volume)} {cubic}") for name, volume in list_volumes(result)),
        (tell("tolerance"), f"{number(result.tolerance, 3)} {book.unit}"),
    ]
    if result.coverage is not None:
        facts.append((tell("skin seen"), book.words.share(result.coverage.seen)))
    facts += _describe_pose(book)
    left = pair_table(facts, 0.56 * WIDTH, 0.36)
    both = Table([[left, picture(image, 0.42 * WIDTH)]], [0.57 * WIDTH, 0.43 * WIDTH])
    both.setStyle([("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (-1, -1), 0)])
    story = [
        write(result.name, 15, True, spaceAfter=3),
        write(_write_verdict(book), 10, True, LEVELS[choose_tone(result)], spaceAfter=5),
        both,
    ]
    if result.sites:
        story += [head(tell("Sites")), _list_sites(book)]
    notes = [*result.failures, *map(str, merge_notes(result.warnings))]
    if notes:
        story.append(head(tell("Notes")))
        story += [write(f"– {note}", 7.5) for note in notes[:MOST_NOTES]]
        if len(notes) > MOST_NOTES:
            story.append(write(tell("{number} more are in result.json", number=len(notes) - MOST_NOTES), 7.5))
    story += [head(tell("Inputs and program")), _trace(book), KeepTogether([Spacer(1, 8), _make_signatures(book)])]
    return story


def _write_verdict(book: Book) -> str:
    result, words = book.result, book.words
    if not result.sites:
        if result.failures:
            return words.tell("Incomplete: no damage volume was found")
        depth = f"{words.number(result.tolerance, 3)} {book.unit}"
        return words.tell("No damage deeper than the tolerance of {depth} was found", depth=depth)
    levels = [site.verdict.level for site in result.sites]
    names = {"proven": words.tell("proven"), "likely": words.tell("likely"), "doubtful": words.tell("doubtful")}
    parts = [f"{levels.count(level)} {name}" for level, name in names.items() if level in levels]
    text = f"{words.count('{number} site', '{number} sites', len(levels))}: {', '.join(parts)}"
    out = sum(not site.accepted for site in result.sites)
    if out:
        text += "; " + words.tell("{out} not part of the damage volume", out=out)
    if result.failures:
        text += "; " + words.tell("incomplete: {failed} failed", failed=len(result.failures))
    return text


def _name_scans(book: Book) -> str:
    names = [Path(path).name for path in book.content["scan"]["paths"]]
    text = ", ".join(names[:3]) + (f" + {len(names) - 3}" if len(names) > 3 else "")
    return f"{text or book.words.tell('given as array')}, {book.content['scan']['points']} {book.words.tell('points')}"


def _describe_pose(book: Book) -> list[tuple[str, str]]:
    pose, tell, number = book.result.pose, book.words.tell, book.words.number
    if pose.datums:
        rows = [
            (tell("datum {name}", name=datum.name),
             f"{datum.kind}" + (f", {tell('faces')} {', '.join(map(str, datum.faces))}" if datum.faces else "")
             + f"; rms {number(datum.rms, 2)} {book.unit}")
            for datum in pose.datums
        ]  # fmt: skip
    elif count := _count_datums(book.job_text):
        text = book.words.count("{number} selection of the skin", "{number} selections of the skin", count)
        rows = [(tell("datums"), f"{text}; rms {number(pose.rms, 2)} {book.unit}")]
    else:
        rows = [(tell("datums"), tell("none: fitted to the skin, rms {rms} {unit}",
                                      rms=number(pose.rms, 2), unit=book.unit))]  # fmt: skip
    return rows + [(tell("not fixed"), motion.text) for motion in (*pose.free, *pose.left)]


def _count_datums(job_text: str) -> int:
    """How many selections of skin the job fits the pose to."""
    from ruamel.yaml import YAML

    align = YAML(typ="safe").load(job_text).get("align") or {}
    return len(align.get("datum") or ()) if isinstance(align, Mapping) else 0


def _list_sites(book: Book) -> Table:
    tell, number, unit = book.words.tell, book.words.number, book.unit
    rows = [[tell("site"), f"{tell('volume')}, {unit}³", tell("95 % interval"), f"{tell('depth')}, {unit}",
             tell("verdict")]]  # fmt: skip
    for site in book.result.sites[:MOST_ROWS]:
        verdict = tell(site.verdict.level) + ("" if site.accepted else f" ({tell('not in the sum')})")
        rows.append([str(site.id), number(site.damage.volume), book.interval(site.volume_95, f"{unit}³"),
                     number(site.max_depth, 3), verdict])  # fmt: skip
    if len(book.result.sites) > MOST_ROWS:
        rows.append([f"+ {len(book.result.sites) - MOST_ROWS}", "", "", "", ""])
    return grid_table(rows, [0.1 * WIDTH, 0.2 * WIDTH, 0.34 * WIDTH, 0.14 * WIDTH, 0.22 * WIDTH], 8)


def _trace(book: Book) -> Table:
    """Digests of the inputs, versions, and the implementation of each stage."""
    from damageest.io.files import file_sha256

    content, tell = book.content, book.words.tell
    rows = [(tell("part"), f"SHA-256 {content['part']['sha256'] or '–'}")]
    for path in book.result.scan.paths[:3]:
        known = file_sha256(Path(path)) if Path(path).is_file() else "–"
        rows.append((f"{tell('scan')} {Path(path).name}", f"SHA-256 {known}"))
    versions = ", ".join(f"{name} {version}" for name, version in content["versions"].items())
    stages = dict.fromkeys((record.stage, record.use) for record in book.result.stages)
    rows.append((tell("job"), f"SHA-256 {sha256(book.job_text.encode()).hexdigest()}"))
    rows += [(tell("versions"), versions), (tell("stages"), ", ".join(f"{stage}: {use}" for stage, use in stages))]
    return pair_table(rows, WIDTH, 0.22, 6.5)


def _make_signatures(book: Book) -> Table:
    tell = book.words.tell
    names = [tell("measured by"), tell("checked by"), tell("released by")]
    label = style(7, colour=SOFT)
    cells = [[write(name, 8, True) for name in names], ["", "", ""],
             [write(tell("name, date, signature"), 7, colour=SOFT)] * 3]  # fmt: skip
    table = Table(cells, [WIDTH / 3] * 3, [5 * mm, 13 * mm, 1.5 * label.leading])
    table.setStyle(
        [("LINEBELOW", (k, 1), (k, 1), 0.6, SOFT) for k in range(3)] + [("BOX", (0, 0), (-1, -1), 0.4, LINE)]
    )
    return table


def _show_site(book: Book, site: Site, shown: Shown) -> list[Any]:
    tell, number, unit = book.words.tell, book.words.number, book.unit
    rows = [
        (tell("verdict"), tell(site.verdict.level) + ("" if site.accepted else f" ({tell('not in the sum')})")),
        (tell("volume"), f"{number(site.damage.volume)} {unit}³"),
        (tell("95 % interval"), book.interval(site.volume_95, f"{unit}³")),
        (tell("depth"), f"{number(site.max_depth, 3)} {unit}"),
        (tell("depth, 95 % interval"), book.interval(site.depth_95, unit)),
        (tell("centre"), "(" + "; ".join(number(x) for x in site.centroid) + f") {unit}"),
        (tell("inner area"), f"{number(site.surface.area)} {unit}²"),
        (tell("scan points"), str(len(site.points))),
        (tell("method"), site.method),
    ]
    if shown.faces:
        rows.append((tell("CAD faces"), shown.faces))
    if site.deposit is not None:
        rows.append((tell("deposit"), f"{number(site.deposit.volume)} {unit}³"))
    left = pair_table(rows, 0.55 * WIDTH, 0.38)
    right = picture(shown.picture, 0.42 * WIDTH) if shown.picture else ""
    both = Table([[left, right]], [0.57 * WIDTH, 0.43 * WIDTH])
    both.setStyle([("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (-1, -1), 0)])
    story = [write(tell("Site {number}", number=site.id), 14, True, LEVELS[site.verdict.level], spaceAfter=4), both]
    drawing = lay_out_site(result=book.result, site=site)
    if drawing is not None:
        legend = tell("section through the deepest point; grey: part as designed, red: damage, green: scan points")
        story += [head(tell("Section")), Plot(drawing, 0.8 * WIDTH, clean_line(legend))]
    story.append(head(tell("Reasons")))
    reasons = shown.reasons or [tell("The scan gives no reason to doubt this site.")]
    story += [write(f"– {text}", 8) for text in reasons]
    known = site.uncertainty
    if known is not None and known.budget is not None:
        story += show_budget(book, known.budget, tell("volume"), f"{unit}³")
    if known is not None and known.depth_budget is not None:
        story += show_budget(book, known.depth_budget, tell("depth"), unit)
    return story


def _draw_part(result: Result, remains: Remains, direction: Any) -> bytes:
    """What is left of the part, with the inner surfaces of the sites in colour."""
    body = result.undamaged if result.undamaged is not None else result.part
    up = np.eye(3)[2] if abs(direction[2]) < 0.9 else np.eye(3)[1]
    way = np.asarray(direction, float) / np.linalg.norm(direction)
    up = up - (up @ way) * way
    view = View(result.part.bounds.mean(axis=0), 0.5 * result.part.diagonal, way, up / np.linalg.norm(up))
    rays = remains.without_accepted(body)[1]
    layers: list[tuple[RayCaster, Mesh, str]] = [(rays, body, "#c3ccd2")]
    for site in result.sites:
        if len(site.surface.faces):
            small = thin_mesh(site.surface, TRIANGLES)  # a little nearer, so that the part does not hide it
            small = Mesh(small.vertices + 2e-3 * result.part.diagonal * way, small.faces)
            layers.append((RayCaster(small), small, colours.colour_site(site.id)))
    return draw(view, layers, (420, 340), True)

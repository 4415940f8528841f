"""A result in a notebook: a sentence, the table of sites, a section through the largest ones, and a picture."""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from damageest.geometry.solids import to_manifold
from damageest.geometry.views import choose_view
from damageest.io import colours
from damageest.stages.report import _style as style
from damageest.stages.report._page import choose_tone, describe_run
from damageest.stages.report._section import choose_plane, draw_histogram, draw_section
from damageest.stages.report._values import show_interval, show_site_interval, show_total_interval

if TYPE_CHECKING:
    from damageest.result import Result, Site

MOST_DRAWN = 2
"""Sites with a section, those of the largest volume: a notebook has many outputs on one page."""
MOST_LISTED = 20
"""Sites in the table."""
COLOURS = (
    "--ink:#1c2329;--soft:#6a757d;--ground:#ffffff;--metal:#dfe4e8;"
    "background:#ffffff;color:#1c2329;padding:8px;display:inline-block;max-width:960px;font:13px system-ui,sans-serif"
)
"""Style of the whole: a light ground of its own, since a notebook may be dark."""
TONES = {"proven": "#1f7a4d", "likely": "#9a6700", "doubtful": "#b3362c"}
CELL = "padding:2px 10px 2px 0;text-align:left;background:#ffffff;color:#1c2329"


def make_snippet(result: Result) -> str:
    """The result as HTML that needs no script and no file. Every id in it is used once on a page with other results."""
    largest = sorted(result.sites, key=lambda site: -site.damage.volume)[:MOST_DRAWN]
    drawings = _draw_sections(result, largest) if largest else [("how far intact points are", draw_histogram(result))]
    picture = _draw_picture(result) if result.sites and find_spec("PIL") is not None else ""
    figures = [*([("all sites, in the remaining part", picture)] if picture else []), *drawings]
    shown = "".join(
        f'<figure style="margin:0 12px 0 0;display:inline-block;width:300px;vertical-align:top">{image}'
        f'<figcaption style="color:#6a757d">{escape(caption)}</figcaption></figure>'
        for caption, image in figures
    )
    tone = TONES[choose_tone(result)]
    head = f'<p style="margin:0 0 6px"><b>{escape(result.name)}</b>: <span style="color:{tone}">'
    text = f"{head}{escape(describe_run(result))}</span></p>{_tabulate(result)}<div>{shown}</div>"
    unique = "d" + sha256(text.encode()).hexdigest()[:10]
    for name in ("section-", "histogram"):
        text = text.replace(f'"{name}', f'"{unique}-{name}').replace(f"#{name}", f"#{unique}-{name}")
    return f'<div style="{COLOURS}">{text}</div>'


def _tabulate(result: Result) -> str:
    """The table of sites, and the total."""
    unit = result.units
    heads = ("site", "volume", "95 %", "depth", "method", "verdict")
    rows = []
    for site in result.sites[:MOST_LISTED]:
        mark = f'<span style="color:{colours.colour_site(site.id)}">■</span> '
        level = escape(site.verdict.level + ("" if site.accepted else ", not accepted"))
        values = [
            f"{style.format_number(site.damage.volume)} {unit}³", show_site_interval(site, unit),
            f"{style.format_number(site.max_depth, 3)} {unit}", site.method,
        ]  # fmt: skip
        cells = [
            f"{mark}{site.id}",
            *map(escape, values),
            f'<span style="color:{TONES[site.verdict.level]}">{level}</span>',
        ]
        rows.append("<tr>" + "".join(f'<td style="{CELL}">{cell}</td>' for cell in cells) + "</tr>")
    more = len(result.sites) - MOST_LISTED
    rows += [f'<tr><td colspan="6" style="{CELL}">and {more} more</td></tr>'] if more > 0 else []
    total = f"damage volume {style.format_number(result.damage_volume)} {unit}³"
    interval = show_total_interval(result)
    total += f" (95 %: {interval})" if interval else ""
    total += f"; {told}" if (told := result.describe_volumes()) else ""
    seen = f"; the scan shows {style.format_share(result.coverage.seen)} of the skin" if result.coverage else ""
    said = f"{total}; tolerance {style.format_number(result.tolerance)} {unit}{seen}"
    top = "<tr>" + "".join(f'<th style="{CELL};color:#6a757d">{head}</th>' for head in heads) + "</tr>"
    table = f'<table style="border-collapse:collapse;margin:0 0 6px">{top}{"".join(rows)}</table>' if rows else ""
    return f'{table}<p style="margin:0 0 6px">{escape(said)}</p>'


def _draw_sections(result: Result, sites: list[Site]) -> list[tuple[str, str]]:
    """A section through the deepest point of each site, with its caption."""
    part = to_manifold(result.part, result.part.bounds.mean(axis=0))
    drawn = []
    for site in sites:
        image, _ = draw_section(result, site, choose_plane(result, site), part)
        depth = show_interval(site.depth_95, result.units)
        drawn.append((f"site {site.id}, section through its deepest point" + (f" ({depth})" if depth else ""), image))
    return drawn


def _draw_picture(result: Result) -> str:
    """What is left of the part and the surfaces of the losses, as an image within the page."""
    from damageest.artefacts import Mesh
    from damageest.geometry.rays import RayCaster
    from damageest.geometry.solids import concatenate_meshes
    from damageest.geometry.views import OVERVIEWS
    from damageest.stages.report._drawing import draw

    left = result.undamaged or result.part
    rays = RayCaster(left)
    surfaces = [site.surface for site in result.sites if len(site.surface.faces)]
    joined = Mesh(*concatenate_meshes(surfaces)[:2]) if surfaces else left
    view = choose_view(rays, joined, left.bounds, left.diagonal, OVERVIEWS)
    view = view._replace(radius=0.75 * view.radius)  # of the sphere around the part, most is empty
    layers: list[Any] = [(rays, left, "#c3ccd2")]
    layers += [
        (RayCaster(site.surface), site.surface, colours.colour_site(site.id))
        for site in result.sites
        if len(site.surface.faces)
    ]
    image = b64encode(draw(view, layers, (300, 200), True)).decode()
    return f'<img alt="the part and its damage" style="width:300px" src="data:image/png;base64,{image}">'

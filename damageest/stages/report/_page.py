"""The page: its template filled."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest.io import colours
from damageest.io.files import embed_png, file_sha256
from damageest.result import Result
from damageest.rules.notes import merge_notes, qualify_nothing
from damageest.stages.report import _style as style
from damageest.stages.report._section import draw_histogram
from damageest.stages.report._sections import draw_sections, group_sections
from damageest.stages.report._sites import MOST_DRAWN, Shown
from damageest.stages.report._values import list_fit, list_freedom, list_sensor, show_total_interval
from damageest.stages.report._words import ENGLISH_WORDS, N_, Words
from damageest.stages.report.scene.scene import EXAGGERATED, LAYERS, Scene

FOLDER = Path(__file__).parent / "page"
DEFINE = "window.define = (name, needs, make) => { window.k3d = make(); };"
"""The script that takes the library of the 3D view over."""
LABELS = {
    "intact": N_("points on the nominal surface"),
    "damage": N_("points in a site"),
    "added": N_("points on surplus"),
    "outlier": N_("other points"),
}
"""Label of result.json to what the page says of its points."""
WHY = {
    "hidden": N_("hidden by the part from every scanner position"),
    "outside": N_("outside every view"),
    "no points": N_("in view, but without points"),
    "earlier scan": N_("not in the earlier scan either"),
    "unknown": N_("unknown"),
}

SCRIPT = (
    N_("as designed"), N_("as it is"), N_("{factor} times"), N_("site {number}:"), N_("all {count}"),
    N_("1 to {last} of {count}"),
)  # fmt: skip
"""Texts of the page's script."""


def fill_page(
    result: Result, content: Mapping[str, Any], job_text: str, scene: Scene, sites: list[Shown], start: Floats,
    words: Words,
) -> str:  # fmt: skip
    """The whole page as text. ``start``: the direction (3,) from which the 3D view looks at first."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": style.format_number,
        "share": style.format_share,
        "at": _format_point,
        "png": embed_png,
        "told": words.tell,
    }
    environment.globals |= {"t": words.tell, "language": words.language}
    environment.filters["name"] = lambda path: Path(path).name
    view = {
        "objects": scene.objects,
        "layers": list(_used_layers(scene)),
        "sites": {site.id: site.view for site in sites},
        "start": start.tolist(),
        "origin": scene.origin,
        "size": scene.size,
        "unit": result.units,
        "exaggerate": scene.exaggerate,
        "words": {text: words.tell(text) for text in SCRIPT},
    }
    scripts = [DEFINE, _read_library(), (FOLDER / "report.js").read_text(encoding="utf-8")]
    return environment.get_template("report.html").render(
        title=result.name,
        unit=result.units,
        r=content,
        sites=sites,
        notes=list(map(str, merge_notes(result.warnings))),
        drawn=MOST_DRAWN,
        exaggerated=EXAGGERATED,
        heights=max((item["height"] for item in scene.objects), default=0),
        verdict=describe_run(result, words),
        tone=choose_tone(result),
        volumes=_describe_volumes(result, words),
        total=f"{style.format_number(result.damage_volume)} {result.units}³",
        interval=show_total_interval(result, words),
        scene=scene,
        layers=[(name, *LAYERS[name]) for name in _used_layers(scene)],
        view=view,
        snapshot=scene.snapshot,
        scripts=scripts,
        policy=make_policy(scripts),
        look=(FOLDER / "report.css").read_text(encoding="utf-8"),
        map_colours=_sample_map(),
        histogram=draw_histogram(result, words),
        labels=LABELS,
        sections=group_sections(result, words),
        drawings=draw_sections(result),
        fit=list_fit(result, words),
        freedom=list_freedom(result),
        sensor=list_sensor(result, words),
        why=WHY,
        hashes=_hash_scans(result, content),
        job=job_text,
        dates=_list_dates(result, words),
        seconds=sum(record.seconds for record in result.stages),
        cached=sum(record.cached for record in result.stages),
    )


def make_policy(scripts: Sequence[str]) -> str:
    """The content security policy of the page: these scripts run and no others, and nothing is fetched."""
    allowed = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    fixed = "default-src 'none'; img-src data: blob:; font-src data:; style-src 'unsafe-inline'; worker-src blob:"
    return f"{fixed}; script-src {allowed}"


def describe_run(result: Result, words: Words = ENGLISH_WORDS) -> str:
    """The verdict on the run in one sentence."""
    tell, failed = words.tell, len(result.failures)
    seen = result.coverage.seen if result.coverage else 1.0
    shown = tell("on the {share} of the skin that the scan shows", share=style.format_share(seen))
    on = f" {shown}" if seen < 0.995 else ""
    if not result.sites:
        if failed:
            return f"{tell('Incomplete: no damage volume was found')} ({_count(failed, words)})."
        depth = f"{style.format_number(result.tolerance)} {result.units}"
        text = tell("No damage deeper than the tolerance of {depth} was found", depth=depth)
        more = " " + tell("that errors of the scan do not explain") if qualify_nothing(result.warnings) else ""
        return f"{text}{on}{more}."
    levels = [site.verdict.level for site in result.sites]
    names = {"proven": tell("proven"), "likely": tell("likely"), "doubtful": tell("doubtful")}
    parts = [f"{levels.count(level)} {name}" for level, name in names.items() if level in levels]
    counted = tell("all {level}", level=names[levels[0]]) if len(parts) == 1 and len(levels) > 1 else ", ".join(parts)
    counted = names[levels[0]] if len(levels) == 1 else counted
    text = f"{_count(len(levels), words)}{on}: {counted}"
    if out := sum(not site.accepted for site in result.sites):
        text += "; " + tell("{out} not part of the damage volume", out=out)
    return text + ("; " + tell("incomplete: {failed} failed", failed=failed) if failed else "") + "."


def choose_tone(result: Result) -> str:
    """The level that the colour of the verdict shows."""
    levels = {site.verdict.level for site in result.sites}
    if result.failures or "doubtful" in levels:
        return "doubtful"
    return "likely" if "likely" in levels else "proven"


def _count(number: int, words: Words) -> str:
    return words.count("{number} site", "{number} sites", number)


def list_volumes(result: Result) -> list[tuple[str, float]]:
    """Lost metal, cut-back and stock, where there is more than the first."""
    if not result.describe_volumes():
        return []
    more = ((N_("cut-back"), result.cut_back_volume), (N_("stock"), result.stock_volume))
    return [(N_("lost metal"), result.lost_volume), *((name, volume) for name, volume in more if volume > 0)]


def _describe_volumes(result: Result, words: Words) -> str:
    return ", ".join(f"{words.tell(name)} {volume:.4g} {result.units}³" for name, volume in list_volumes(result))


def _format_point(values: Any) -> str:
    return "(" + ", ".join(style.format_number(value) for value in values) + ")"


def _used_layers(scene: Scene) -> list[str]:
    used = {item["layer"] for item in scene.objects}
    return [name for name in LAYERS if name in used]


def _read_library() -> str:
    """k3d's script for pages that stand alone, as its wheel carries it."""
    found = find_spec("k3d")
    path = Path(found.origin).parent / "static" / "standalone.js" if found and found.origin else None
    if path is None or not path.is_file():
        raise StageError("the Python package k3d has no script for the 3D view", "pip install --force-reinstall k3d")
    # an end tag within the script would end it; the files that it names beside the fonts that it carries are not there
    text = path.read_text(encoding="utf-8").replace("</script", "<\\/script")
    return re.sub(r',url\(fonts/[\w.-]+\) format\("\w+"\)', "", text)


def _sample_map() -> str:
    """The colour bar as stops of a CSS gradient."""
    return ", ".join(colours.COOLWARM)


def _hash_scans(result: Result, content: Mapping[str, Any]) -> dict[str, str]:
    """The SHA-256 of each scan file, by its path in result.json; empty for one that is gone."""
    pairs = zip(content["scan"]["paths"], result.scan.paths, strict=True)
    return {shown: file_sha256(Path(path)) if Path(path).is_file() else "" for shown, path in pairs}


def _list_dates(result: Result, words: Words) -> list[tuple[str, str]]:
    """When the input files were changed last, and now. The page keeps it apart, since it is not the same twice."""
    paths = [(words.tell("part"), result.part.path), *((words.tell("scan"), path) for path in result.scan.paths)]
    dates = []
    for kind, name in paths:
        if name and Path(name).is_file():
            changed = datetime.fromtimestamp(Path(name).stat().st_mtime, UTC)
            dates.append((words.tell("{file} of", file=f"{kind} {Path(name).name}"), f"{changed:%Y-%m-%d %H:%M} UTC"))
    return [*dates, (words.tell("report of"), f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC")]

"""The page of a record, `record.html`: to be read and printed, without scripts."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from damageest.inspection.discrepancies import name_places

STYLE = """body{font:15px/1.45 system-ui,sans-serif;max-width:60rem;margin:0 auto;padding:1rem;color:#1c2329}
h1{font-size:1.5rem}h2{font-size:1.15rem;border-top:1px solid #d8dde1;padding-top:.8rem}
table{border-collapse:collapse}th{text-align:left;color:#6a757d}td,th{padding:.2rem .8rem .2rem 0;vertical-align:top}
tbody tr{border-top:1px solid #d8dde1}.met{color:#1f7a4d}.not{color:#b3362c}code,.note{font-size:.8rem;color:#6a757d}"""
POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def write_page(record: Mapping[str, Any], path: Path) -> None:
    """Writes the page of a record."""
    path.write_text(describe(record), encoding="utf-8")


def describe(record: Mapping[str, Any]) -> str:
    """The page as text."""
    unit, before = str(record["units"]), record["inspection_before"]
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        f"<meta http-equiv='Content-Security-Policy' content=\"{POLICY}\">"
        f"<title>{_show(record['name'])} – repair record</title><style>{STYLE}</style></head><body>",
        f"<h1>{_show(record['name'])}: repair record</h1>",
        f"<h2>Workpiece</h2><p>{_show(Path(record['workpiece']['part']['path']).name or 'given as arrays')}<br>"
        f"<code>sha256 {_show(record['workpiece']['part']['sha256'])}</code></p>",
        f"<h2>Inspection before</h2><p>{_describe_lost(before, unit)}, tolerance "
        f"{_number(before['tolerance'])} {unit}</p>",
        _table(
            ["site", "verdict", "repaired", f"volume, {unit}³", f"depth, {unit}"],
            [[s["site"], s["verdict"], "yes" if s["repaired"] else "no", s["volume"], s["depth"]]
             for s in before["sites"]],
        ),
        "<h2>Deposition</h2>",
        _table(
            ["site", f"deposit, {unit}³", f"stock, {unit}³", f"least stock, {unit}", "path"],
            [[s["site"], s["deposit_volume"], s["stock_volume"], (s["stock_thickness"] or {}).get("min"),
              "planned" if s["path"] else "none"] for s in record["deposition"]["sites"]],
        ),
        *(_describe_entry(entry, unit) for entry in record["inspections"]),
        f"<p class='note'>sha256 of record.json's content: {_show(record['sha256'])}</p></body></html>\n",
    ]  # fmt: skip
    return "\n".join(parts)


def _describe_entry(entry: Mapping[str, Any], unit: str) -> str:
    whole = entry.get("whole")  # entries of older versions have none
    verdicts = "".join(
        f"<p class='{'met' if one['outcome'] == 'met' else 'not'}'>Site {one['site']}: tolerance {one['outcome']}"
        f"{': ' + _show(one['why']) if one['why'] else ''}"
        f"{_describe_shown(one, unit)}</p>"
        for one in entry["verdicts"]
    )
    if whole:
        why = f": {_show(whole['why'])}" if whole["why"] else ""
        verdicts += f"<p class='{'met' if whole['outcome'] == 'met' else 'not'}'>Part as a whole: "
        verdicts += f"{_show(whole['outcome'])}{why}</p>"
    findings = _table(
        ["finding", "site", f"volume, {unit}³", "95 %", f"depth, {unit}", "centre", ""],
        [[one["kind"], name_places(one.get("sites") or [one["site"]]), one["volume"], _interval(one), one["depth"],
          ", ".join(_number(x) for x in one["centre"]), one["level"]] for one in entry["findings"]],
    )  # fmt: skip
    off = entry["pose"]["rms_on_unrepaired"]
    return (
        f"<h2>Inspection: {_show(entry['step'])}, {_show(entry['time'])}</h2>"
        f"<p>{_show(entry['scan']['name'])}, {entry['scan']['points']} points<br>"
        f"<code>sha256 {_show(entry['scan']['sha256'])}</code></p>"
        f"<p>Pose {_show(entry['pose']['by'])}; deviation from unrepaired skin {_number(off)} {unit} "
        f"(rms). Tolerance {_number(entry['tolerance'])} {unit}.</p>{verdicts}{findings}"
        + "".join(f"<p class='note'>{_show(note)}</p>" for note in entry["notes"])
    )


def _describe_lost(before: Mapping[str, Any], unit: str) -> str:
    """Lost metal, and the cavity where a cut-back enlarged it."""
    whole, lost = before["damage_volume"], before.get("lost_volume", before["damage_volume"])
    told = f"Lost metal {_number(lost)} {unit}³"
    return told if lost == whole else f"{told}, cavity with the cut-back {_number(whole)} {unit}³"


def _describe_shown(one: Mapping[str, Any], unit: str) -> str:
    if one.get("shows") is None:
        return ""
    return f"<br><span class='note'>Smallest defect that the scan shows: {_number(one['shows'])} {unit}.</span>"


def _interval(one: Mapping[str, Any]) -> str:
    if one["low"] is None:
        return "–"
    return f"{_number(one['low'])} … {_number(one['high'])}"


def _table(head: list[str], rows: list[list[Any]]) -> str:
    if not rows:
        return "<p>none</p>"
    top = "".join(f"<th>{_show(text)}</th>" for text in head)
    body = "".join("<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: Any) -> str:
    return _number(value) if isinstance(value, float) or value is None else _show(value)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def _show(value: object) -> str:
    return escape(str(value))

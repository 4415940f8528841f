"""Writes a deposition path as G-code (RS-274): 3 axes, or 5 axes with the control's tool centre point (TCPM)."""

from __future__ import annotations

from pathlib import Path
from string import Template

import numpy as np

from damageest.artefacts import DepositPath, Floats
from damageest.errors import StageError
from damageest.stages.export import PathSettings

TO_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}
TO_INCH = {"in": 1.0, "ft": 12.0}
HEADER = "G17 G40 G49 G80 G90 G94\n$units"
FOOTER = "M2"
OPTIONS = {"on": "M3", "off": "M5", "rotary": "auto", "tcpm_on": "G43.4 H1", "tcpm_off": "G49"}
"""What a job may set, and the defaults. ``rotary``: AC, BC, none, or auto: AC where the tool axis is not always z."""


def write_rs274(file: Path, path: DepositPath, settings: PathSettings) -> None:
    """Blocks of G1, travel too, since its speed is given. ``$title``, ``$units`` and ``$site`` are replaced in
    the templates of the first and last lines.

    Coordinates are those of the frame asked for: the control's tool centre point function turns them. The tool axis is
    Rz(C) Rx(A) z for AC, and Rz(C) Ry(B) z for BC. Raises StageError for a tilted tool without rotary axes, or for an
    option that is not known.
    """
    options = _check_options(settings)
    factor = TO_INCH.get(settings.unit) or TO_MM[settings.unit]
    straight = bool(len(path.axes) == 0 or (np.abs(path.axes - [0, 0, 1]).max() < 1e-9))
    rotary = options["rotary"]
    if rotary == "auto":
        rotary = "none" if straight else "AC"
    if rotary == "none" and not straight:
        raise StageError(
            "rs274: the tool axis is not along z, and rotary is none",
            "path.direction: [0, 0, 1] with path.axes: 3, or rotary AC or BC",
        )
    words = {
        "title": settings.title.replace("(", "[").replace(")", "]"),
        "units": "G20" if settings.unit in TO_INCH else "G21",
        "site": str(settings.site),
    }
    lines = [f"({words['title']})", *_fill_in(HEADER if settings.header is None else settings.header, words)]
    angles = _find_angles(path.axes, rotary)
    lines += [options["tcpm_on"]] if rotary != "none" else []
    on, feed, layer = False, "", 0
    for k in range(len(path.points)):
        if path.layer[k] != layer:
            layer = int(path.layer[k])
            lines.append(f"(part {path.part[k]} layer {layer})")
        if bool(path.on[k]) != on:
            on = bool(path.on[k])
            lines.append(options["on" if on else "off"])
        x, y, z = path.points[k] * factor + 0.0
        text = f"G1 X{x:.5f} Y{y:.5f} Z{z:.5f}"
        if rotary != "none":
            text += f" {rotary[0]}{angles[k, 0] + 0.0:.5f} C{angles[k, 1] + 0.0:.5f}"
        speed = " F" + f"{path.feed[k] * factor:.4f}".rstrip("0").rstrip(".")
        lines.append(text + (speed if speed != feed else ""))
        feed = speed
    lines += [options["off"]] if on else []
    lines += [options["tcpm_off"]] if rotary != "none" else []
    lines += _fill_in(FOOTER if settings.footer is None else settings.footer, words)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _check_options(settings: PathSettings) -> dict[str, str]:
    unknown = sorted(set(settings.options) - set(OPTIONS))
    if unknown:
        raise StageError(f"rs274 has no option {', '.join(unknown)}", f"one of {', '.join(OPTIONS)}")
    options = {**OPTIONS, **settings.options}
    if options["rotary"] not in ("auto", "none", "AC", "BC"):
        raise StageError(f"rs274: rotary is '{options['rotary']}'", "auto, none, AC or BC")
    return options


def _fill_in(template: str, words: dict[str, str]) -> list[str]:
    return Template(template).safe_substitute(words).rstrip("\n").split("\n")


def _find_angles(axes: Floats, rotary: str) -> Floats:
    """Angles (N,2) in degrees: of A or B, from 0 to 180, and of C, without jumps of a whole turn.

    Where the axis is along z, C keeps its value.
    """
    if rotary == "none" or not len(axes):
        return np.zeros((len(axes), 2))
    tilt = np.degrees(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2]))
    # Rz(C) Rx(A) z = sin A (sin C, -cos C) ; Rz(C) Ry(B) z = sin B (cos C, sin C)
    x, y = (-axes[:, 1], axes[:, 0]) if rotary == "AC" else (axes[:, 0], axes[:, 1])
    turn = np.arctan2(y, x)
    known = np.flatnonzero(tilt > 1e-6)
    if not len(known):
        return np.zeros((len(axes), 2))
    held = known[np.clip(np.searchsorted(known, np.arange(len(axes)), side="right") - 1, 0, None)]
    return np.column_stack([tilt, np.degrees(np.unwrap(turn[held]))])

"""Writes a deposition path as G-code (RS-274): 3 axes, or 5 axes with the tool centre point of the control (TCPM), of
the machine's kinematics, or of the program itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from string import Template

import numpy as np

from damageest.artefacts import DepositPath, Floats
from damageest.errors import StageError
from damageest.stages.export import PathSettings, describe_setup
from damageest.stages.export._rotary import Turned, find_angles, turn_table

TO_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}
TO_INCH = {"in": 1.0, "ft": 12.0}
HEADER = "G17 G40 G49 G80 G90 G94\n$units $offset"
FOOTER = "M2"
OPTIONS = {
    "on": "M3", "off": "M5", "power": "", "work_offset": "", "rotary": "auto", "tcp": "control", "tcpm_on": "G43.4 H1",
    "tcpm_off": "G49", "pivot": "0 0 0",
}  # fmt: skip
"""What a job may set, and the defaults. ``rotary``: AC, BC, none, or auto: AC where the tool axis is not always z.
``tcp``: control (``tcpm_on``, ``tcpm_off``), machine (its kinematics do it, nothing is written), table (the points are
turned about ``pivot``, in the job's unit). ``power``: the S word of ``on``."""
CHOICES = {"rotary": ("auto", "none", "AC", "BC"), "tcp": ("control", "machine", "table")}


def write_rs274(file: Path, path: DepositPath, settings: PathSettings) -> None:
    """G0 to the first point, then blocks of G1, travel too, since its speed is given and its way is straight.

    ``$title``, ``$units``, ``$offset`` and ``$site`` are replaced in the templates of the first and last lines.
    Coordinates are those of the frame asked for. For the angles see `find_angles`; for a table that turns see
    `turn_table`: there each move has its time (G93). Raises StageError for a tilted tool without rotary axes, or for an
    option that is not known.
    """
    options = _check_options(settings)
    factor = TO_INCH.get(settings.unit) or TO_MM[settings.unit]
    rotary = _choose_rotary(path, options["rotary"])
    words = {
        "title": settings.title.replace("(", "[").replace(")", "]"),
        "units": "G20" if settings.unit in TO_INCH else "G21",
        "offset": options["work_offset"],
        "site": str(settings.site),
    }
    lines = [f"({words['title']})", *(f"({text})" for text in describe_setup(path, factor))]
    lines += _fill_in(HEADER if settings.header is None else settings.header, words)
    angles = find_angles(path.axes, rotary)
    on_table = rotary != "none" and options["tcp"] == "table"
    if on_table:
        moves = turn_table(path, angles, rotary, _read_pivot(options["pivot"]))
    else:
        moves = Turned(path.points, angles, path.moves / path.feed, np.arange(len(path.points)))
    calls_control = rotary != "none" and options["tcp"] == "control"
    lines += [options["tcpm_on"]] if calls_control else []
    lines += _write_moves(path, moves, rotary, factor, options, on_table)
    lines += [options["tcpm_off"]] if calls_control else []
    lines += _fill_in(FOOTER if settings.footer is None else settings.footer, words)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def check_rs274(settings: PathSettings, channels: Sequence[str]) -> None:
    """Raises StageError for options that no path could be written with."""
    options = _check_options(settings)
    if options["tcp"] == "table":
        _read_pivot(options["pivot"])


def _write_moves(
    path: DepositPath, moves: Turned, rotary: str, factor: float, options: dict[str, str], is_timed: bool
) -> list[str]:
    lines: list[str] = []
    power = f" S{options['power']}" if options["power"] else ""
    words = {True: options["on"] + power, False: options["off"]}
    on, feed, layer, waits = False, "", 0, path.waits
    for k, number in enumerate(moves.move.tolist()):
        if path.layer[number] != layer:
            layer = int(path.layer[number])
            lines.append(f"(part {path.part[number]} layer {layer})")
        if bool(path.on[number]) != on:
            on = bool(path.on[number])
            lines.append(words[on])
        x, y, z = moves.points[k] * factor + 0.0
        text = f"G{min(k, 1)} X{x:.5f} Y{y:.5f} Z{z:.5f}"
        if rotary != "none":
            text += f" {rotary[0]}{moves.angles[k, 0] + 0.0:.5f} C{moves.angles[k, 1] + 0.0:.5f}"
        if k == 0:
            lines += [text, "G93"] if is_timed else [text]
        else:
            value = 1 / max(moves.minutes[k], 1e-6) if is_timed else path.feed[number] * factor
            speed = " F" + f"{value:.4f}".rstrip("0").rstrip(".")
            lines.append(text + (speed if speed != feed or is_timed else ""))
            feed = speed
        is_last = k + 1 == len(moves.move) or moves.move[k + 1] != number
        if is_last and waits[number] > 0:
            lines.append(f"G4 P{waits[number]:.3f}")
    lines += [options["off"]] if on else []
    return [*lines, "G94"] if is_timed and lines else lines


def _choose_rotary(path: DepositPath, rotary: str) -> str:
    straight = bool(len(path.axes) == 0 or (np.abs(path.axes - [0, 0, 1]).max() < 1e-9))
    if rotary == "none" and not straight:
        raise StageError("rs274: the tool axis is not along z, and rotary is none", "path.axes: 3, or rotary AC or BC")
    return ("none" if straight else "AC") if rotary == "auto" else rotary


def _check_options(settings: PathSettings) -> dict[str, str]:
    unknown = sorted(set(settings.options) - set(OPTIONS))
    if unknown:
        raise StageError(f"rs274 has no option {', '.join(unknown)}", f"one of {', '.join(OPTIONS)}")
    options = {**OPTIONS, **settings.options}
    for name, known in CHOICES.items():
        if options[name] not in known:
            raise StageError(f"rs274: {name} is '{options[name]}'", f"{', '.join(known[:-1])} or {known[-1]}")
    return options


def _read_pivot(text: str) -> Floats:
    words = text.replace(",", " ").split()
    try:
        pivot = np.array([float(word) for word in words])
    except ValueError:
        pivot = np.empty(0)
    if pivot.shape != (3,) or not np.isfinite(pivot).all():
        raise StageError(f"rs274: pivot is '{text}'", "three numbers: a point on both rotary axes, in the files' frame")
    return pivot


def _fill_in(template: str, words: dict[str, str]) -> list[str]:
    return [line.rstrip() for line in Template(template).safe_substitute(words).rstrip("\n").split("\n")]

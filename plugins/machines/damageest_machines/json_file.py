"""All that is known of a path and its program, as JSON: for other post-processors, and for simulation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import DepositPath
from damageest.stages.export import PathSettings
from damageest_machines.build import build_program
from damageest_machines.files import find_file, read_machine
from damageest_machines.frames import read_quaternions
from damageest_machines.program import Program

VERSION = 1


def write_json(file: Path, path: DepositPath, settings: PathSettings) -> Sequence[str]:
    """The path in the job's unit; with a machine, its program too, in mm and degrees. Returns what the user is told."""
    head: dict[str, Any] = {
        "version": VERSION, "title": settings.title, "units": settings.unit, "site": settings.site,
        "standoff": path.standoff, "width": path.width, "heights": path.heights.tolist(),
        "directions": path.directions.tolist(), "setup": None if path.setup is None else path.setup.tolist(),
        "channels": list(path.channels),
    }  # fmt: skip
    columns: dict[str, Any] = {
        "point": path.points, "axis": path.axes, "normal": path.normals, "feed": path.feed, "on": path.on,
        "layer": path.layer, "pass": path.number, "part": path.part, "bead": path.sizes,
        "dwell": path.waits,
    }  # fmt: skip
    head["path"] = {name: _round(values) for name, values in columns.items()}
    head["path"]["kind"] = [path.kinds[number - 1] if path.kinds else "" for number in path.number.tolist()]
    head["path"]["values"] = [] if path.values is None else path.values.tolist()
    notes: Sequence[str] = ()
    if settings.machine is not None and len(path.points):
        program = build_program(path, settings, read_machine(find_file(settings.machine)))
        head["program"] = describe_program(program)
        notes = program.notes
    file.write_text(json.dumps(head, separators=(",", ":")) + "\n", encoding="utf-8")
    return notes


def describe_program(program: Program) -> dict[str, Any]:
    """The machine, its frames, and each move: ``source`` is the move of the path that it belongs to, from 0, -1 for
    approach and retract. Work offset and tool as transforms (4,4) into the machine's frame, and the flange's."""
    moves, at = program.moves, program.at
    found: dict[str, Any] = {
        "point": moves.points, "axis": moves.axes, "feed": moves.feed, "on": moves.on, "source": moves.source,
        "rotary": at.rotary, "linear": at.linear, "exact": program.exact,
    }  # fmt: skip
    if at.frames is not None:
        found["quaternion"] = read_quaternions(at.frames)
    if at.joints is not None:
        found["joints"] = at.joints
    return {
        "machine": program.machine.model_dump(mode="json"),
        "minutes": round(program.minutes, 4),
        "work_offset": at.base.tolist(),
        "tool": at.tool.tolist(),
        "rotary_axes": [axis.name for axis in program.machine.rotary],
        "moves": {name: _round(values) for name, values in found.items()},
        "values": moves.values.tolist(),
        "notes": list(program.notes),
    }


def _round(values: Any) -> Any:
    return values.tolist() if values.dtype.kind in "bi" else (np.round(values, 9) + 0.0).tolist()

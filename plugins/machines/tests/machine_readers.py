"""Readers of programs, written from the manuals and not from the writers: what each control would do, move by move.

Each gives a `Read`: points and tool axes in the frame of the work offset, which the part has, speeds in mm a minute,
whether the process is on during the move, and the values of its channels.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats

NUMBER = r"[-+]?\d+(?:\.\d+)?(?:E9)?"


@dataclass
class Read:
    points: list[Any] = field(default_factory=list)
    axes: list[Any] = field(default_factory=list)
    feed: list[float] = field(default_factory=list)
    on: list[bool] = field(default_factory=list)
    channels: list[dict[str, float]] = field(default_factory=list)
    exact: list[bool] = field(default_factory=list)
    rotary: list[Any] = field(default_factory=list)

    def add(self, point: Any, axis: Any, feed: float, on: bool, channels: Mapping[str, float], exact: bool) -> None:
        self.points.append(np.asarray(point, float))
        self.axes.append(np.asarray(axis, float))
        self.feed.append(feed)
        self.on.append(on)
        self.channels.append(dict(channels))
        self.exact.append(exact)


def turn(machine: Mapping[str, Any], angles: Mapping[str, float], carries: str) -> tuple[Floats, Floats]:
    """Rotation and shift of what the rotary axes of a machine file carry: the first is next to the bed."""
    R, s = np.eye(3), np.zeros(3)
    for axis in machine.get("rotary", []):
        if axis["carries"] == carries:
            u = np.array(axis["direction"], float)
            own = Rotation.from_rotvec(np.radians(angles[axis["name"]]) * u / np.linalg.norm(u)).as_matrix()
            point = np.array(axis["point"], float)
            R, s = R @ own, R @ (point - own @ point) + s
    return R, s


def axis_of(machine: Mapping[str, Any], angles: Mapping[str, float]) -> Floats:
    """The tool axis in the part's frame of a machine tool whose axes stand so."""
    part, _ = turn(machine, angles, "part")
    tool, _ = turn(machine, angles, "tool")
    return np.asarray(part.T @ tool @ [0, 0, 1.0])


def words(text: str) -> dict[str, float]:
    """Words of a block: letters with an optional digit, '=' or a space or nothing, and a number."""
    return {
        name: float(value) for name, value in re.findall(rf"([A-Z]{{1,2}}\d(?=[ =])|[A-Z]{{1,2}})[ =]?({NUMBER})", text)
    }


def read_krl(text: str, machine: Mapping[str, Any]) -> Read:
    found, on, speed = Read(), False, 0.0
    channels: dict[str, float] = {}
    names = {"1": "power", "2": "powder", "3": "gas"}
    scales = {"power": 0.00025, "powder": 0.02, "gas": 0.04}
    lines = [line.split(";")[0].strip() for line in text.splitlines()]
    assert re.fullmatch(r"DEF \w+\( \)", lines[0])
    assert lines[-1] == "END"
    assert any(line.startswith("$BASE=") for line in lines)
    is_known = False
    for line in lines:
        if line.startswith("PTP"):
            assert "A1 " in line or "S " in line
            is_known = True
        elif line.startswith("$OUT[1]="):
            on = line.endswith("TRUE")
        elif match := re.match(r"\$ANOUT\[(\d)\]=(.*)", line):
            channels[names[match[1]]] = float(match[2]) / scales[names[match[1]]]
        elif line.startswith("$VEL.CP="):
            speed = float(line.partition("=")[2]) * 60000
        elif line.startswith("LIN "):
            assert is_known, "the first motion has to fix the axes"
            values = words(line)
            frame = Rotation.from_euler("ZYX", [values["A"], values["B"], values["C"]], degrees=True).as_matrix()
            exact = not line.endswith("C_DIS")
            found.add([values[c] for c in "XYZ"], -frame[:, 0], speed, on, channels, exact)
            found.rotary.append([values[name] for name in ("E1", "E2") if name in values])
    return found


def read_rapid(text: str, machine: Mapping[str, Any]) -> Read:
    found, on = Read(), False
    channels: dict[str, float] = {}
    names = {"aoPower": "power", "aoFeed": "powder", "aoGas": "gas"}
    assert text.count("MODULE") == 2
    assert text.count("PROC") == 2
    for line in text.splitlines():
        line = line.split("!")[0].strip()
        assert not line or line.endswith(";") or "PROC" in line or "MODULE" in line
        if match := re.match(r"SetDO \w+,(\d);", line):
            on = match[1] == "1"
        elif match := re.match(r"SetAO (\w+),(.*);", line):
            channels[names[match[1]]] = float(match[2])
        elif match := re.match(
            r"MoveL \[\[(.*?)\],\[(.*?)\],\[0,0,0,0\],\[(.*?)\]\],\[(.*?)\],(\w+),(\w+)\\WObj:=(\w+);", line
        ):
            point, turned, extra, speed = ([float(word) for word in match[k].split(",")] for k in range(1, 5))
            assert abs(np.linalg.norm(turned) - 1) < 1e-7
            assert len(extra) == 6
            assert f"PERS tooldata {match[6]}:=" in text
            assert f"PERS wobjdata {match[7]}:=" in text
            frame = Rotation.from_quat([*turned[1:], turned[0]]).as_matrix()
            found.add(point, -frame[:, 2], speed[0] * 60, on, channels, match[5] == "fine")
        elif "Move" in line:
            assert line.startswith("MoveAbsJ")
    return found


def read_fanuc(text: str, machine: Mapping[str, Any]) -> Read:
    found, on = Read(), False
    channels: dict[str, float] = {}
    head, _, rest = text.partition("/MN\n")
    body, _, places = rest.partition("/POS\n")
    assert head.startswith("/PROG ")
    assert places.endswith("/END\n")
    positions = {}
    for hit in re.finditer(r"P\[(\d+)\]\{(.*?)\n\};", places, re.DOTALL):
        positions[int(hit[1])] = {
            name: float(value) for name, value in re.findall(rf"\b([XYZWPR]|J\d) = ({NUMBER}) (?:mm|deg)", hit[2])
        }
    base = frame_of(machine)
    names = {"1": "power", "2": "powder", "3": "gas"}
    for number, line in enumerate(body.splitlines(), 1):
        label, _, rest = line.partition(":")
        assert int(label) == number
        assert rest.endswith(" ;")
        line = rest[:-2].strip()
        if line.startswith("DO[1]="):
            on = line.endswith("ON")
        elif match := re.match(r"R\[(\d)\]=(.*)", line):
            channels[names[match[1]]] = float(match[2])
        elif match := re.fullmatch(r"L P\[(\d+)\] ([\d.]+)mm/sec (FINE|CNT\d+) COORD", line):
            place = positions[int(match[1])]
            # the user frame stands still: the part has turned away from it by the axes of group 2
            R, s = turn(machine, place, "part")
            frame = Rotation.from_euler("xyz", [place["W"], place["P"], place["R"]], degrees=True).as_matrix()
            world = base[:3, :3] @ [place[c] for c in "XYZ"] + base[:3, 3]
            point = base[:3, :3].T @ (R.T @ (world - s) - base[:3, 3])
            axis = -base[:3, :3].T @ R.T @ base[:3, :3] @ frame[:, 2]
            found.add(point, axis, float(match[2]) * 60, on, channels, match[3] == "FINE")
            found.rotary.append([place["J1"], place["J2"]])
    return found


def frame_of(machine: Mapping[str, Any]) -> Floats:
    work = machine["frames"]["work"]
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", work.get("rotation", [0, 0, 0]), degrees=True).as_matrix()
    T[:3, 3] = work["position"]
    return T


def read_sinumerik(text: str, machine: Mapping[str, Any]) -> Read:
    found, on = Read(), False
    channels: dict[str, float] = {}
    state: dict[str, float] = {}
    names = [axis["name"] for axis in machine.get("rotary", [])]
    tracks, mode, g = False, "", ""
    channel = {"H1": "power", "H2": "powder", "H3": "gas"}
    for line in text.splitlines():
        line = line.split(";")[0].strip()
        tracks = True if line == "TRAORI" else False if line == "TRAFOOF" else tracks
        mode = line if line in ("ORIVECT", "ORIAXES") else mode
        if line in ("M100", "M101"):
            on = line == "M100"
        elif match := re.fullmatch(r"(H\d)=(.*)", line):
            channels[channel[match[1]]] = float(match[2])
        elif "SUPA" in line:
            g = "G0"
        elif re.match(r"(G[019] )*X|G0 [A-C]=", line):
            g = next((word for word in line.split() if word in ("G0", "G1")), g)
            state |= words(line)
            if "X" not in line:
                continue
            axis: Any = [0, 0, 1.0]
            if names:
                assert tracks
                vector = [state.get(name) for name in ("A3", "B3", "C3")]
                axis = vector if mode == "ORIVECT" else axis_of(machine, state)
            assert g in ("G0", "G1")
            feed = state["F"] if g == "G1" else np.inf
            found.add([state[c] for c in "XYZ"], axis, feed, on, channels, "G9" in line.split())
            found.rotary.append([state[name] for name in names if mode != "ORIVECT"])
    assert text.rstrip().endswith("M30")
    assert not tracks
    return found


def read_heidenhain(text: str, machine: Mapping[str, Any]) -> Read:
    found, on = Read(), False
    channels: dict[str, float] = {}
    state: dict[str, float] = {}
    channel = {"Q1501": "power", "Q1502": "powder", "Q1503": "gas"}
    tracks, number = False, 0
    blocks = text.replace("~\r\n", "").split("\r\n")
    assert blocks[-1] == ""
    for block in blocks[:-1]:
        label, _, line = block.partition(" ")
        assert int(label) == number
        number += 1
        line = line.split(";")[0].strip()
        tracks = True if line == "M128" else False if line == "M129" else tracks
        if line in ("M100", "M101"):
            on = line == "M100"
        elif match := re.fullmatch(r"FN 0: (Q\d+) = \+(.*)", line):
            channels[channel[match[1]]] = float(match[2])
        elif line.startswith("L") and "M91" not in line:
            values = words(line)
            state |= values
            if "X" not in values:
                continue
            assert tracks
            is_vector = line.startswith("LN ")
            axis = np.array([values[f"T{c}"] for c in "XYZ"]) if is_vector else axis_of(machine, state)
            if is_vector:
                assert abs(np.linalg.norm(axis) - 1) < 1e-6
                assert abs(np.linalg.norm([values[f"N{c}"] for c in "XYZ"]) - 1) < 1e-6
            feed = np.inf if "FMAX" in line else state["F"]
            found.add([values[c] for c in "XYZ"], axis, feed, on, channels, False)
    name = re.match(r"0 BEGIN PGM (\w+) MM", blocks[0])
    assert name
    assert blocks[-2].endswith(f"END PGM {name[1]} MM")
    return found


def read_linuxcnc(text: str, machine: Mapping[str, Any]) -> Read:
    found, on, state = Read(), False, {"F": 0.0}
    channels: dict[str, float] = {}
    names = [axis["name"] for axis in machine.get("rotary", [])]
    is_table = bool(names) and machine.get("post", {}).get("tcp") == "table"
    base, mode, g, inverse = frame_of(machine), "", "", False
    last = None
    for line in text.splitlines():
        line = re.sub(r"\(.*?\)", "", line).strip()
        if line in ("M64 P0", "M65 P0"):
            on = line == "M64 P0"
        elif match := re.fullmatch(r"M68 E(\d) Q(.*)", line):
            channels[("power", "powder", "gas")[int(match[1])]] = float(match[2])
        elif line.startswith(("G61", "G64")):
            mode = line[:3]
        elif "X" in line and "G53" not in line:
            inverse = inverse or "G93" in line
            codes = re.findall(r"G\d+", line)
            g = next((code for code in codes if code in ("G0", "G1")), g)
            state |= words(line)
            point = np.array([state[c] for c in "XYZ"])
            if is_table:
                R, s = turn(machine, state, "part")
                point = base[:3, :3].T @ (R.T @ (base[:3, :3] @ point + base[:3, 3] - s) - base[:3, 3])
            feed = np.inf if g == "G0" else state["F"]
            if inverse and last is not None:
                feed = state["F"] * float(np.linalg.norm(point - last))
            found.add(point, axis_of(machine, state) if names else [0, 0, 1.0], feed, on, channels, mode == "G61")
            found.rotary.append([state[name] for name in names])
            last = point
    assert text.rstrip().endswith("M2")
    return found


READERS: dict[str, Callable[[str, Mapping[str, Any]], Read]] = {
    "krl": read_krl,
    "rapid": read_rapid,
    "fanuc": read_fanuc,
    "sinumerik": read_sinumerik,
    "heidenhain": read_heidenhain,
    "linuxcnc": read_linuxcnc,
}

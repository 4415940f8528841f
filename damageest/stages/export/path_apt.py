"""Writes a deposition path as APT CLDATA in text: GOTO with the tool axis, FEDRAT, RAPID, LOADTL."""

from __future__ import annotations

from pathlib import Path

from damageest.artefacts import DepositPath
from damageest.stages.export import PathSettings, describe_setup

UNITS = {"in": ("INCHES", 1.0, "IPM"), "ft": ("INCHES", 12.0, "IPM")}
TO_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}


def write_apt(file: Path, path: DepositPath, settings: PathSettings) -> None:
    """Millimetres or inches. Deposition stands between INSERT/DEPOSIT ON and INSERT/DEPOSIT OFF. The first point is
    approached in rapid traverse. A channel of the process is INSERT/ with its name and value, where that changes;
    DELAY/ has the seconds of a wait."""
    word, factor, speed = UNITS.get(settings.unit) or ("MM", TO_MM[settings.unit], "MMPM")
    lines = [f"PARTNO {settings.title.upper()}", f"UNITS/{word}", "MULTAX/ON", "LOADTL/1"]
    lines += [f"$$ {text}" for text in describe_setup(path, factor)]
    feed, on, layer, waits = 0.0, False, 0, path.waits
    given: dict[str, str] = {}
    for k in range(len(path.points)):
        if path.layer[k] != layer:
            layer = int(path.layer[k])
            lines.append(f"$$ PART {path.part[k]} LAYER {layer}")
        for name, value in zip(path.channels, () if path.values is None else path.values[k], strict=True):
            if given.get(name) != (text := f"{value:.6g}") and path.on[k]:
                given[name] = text
                lines.append(f"INSERT/{name.upper()} {text}")
        if bool(path.on[k]) != on:
            on = bool(path.on[k])
            lines.append(f"INSERT/DEPOSIT {'ON' if on else 'OFF'}")
        if k == 0:
            lines.append("RAPID")
        elif path.feed[k] != feed:
            feed = float(path.feed[k])
            lines.append(f"FEDRAT/{feed * factor:.6g},{speed}")
        numbers = [*(path.points[k] * factor), *path.axes[k]]
        lines.append("GOTO/" + ",".join(f"{value + 0.0:.6f}" for value in numbers))
        if waits[k] > 0:
            lines.append(f"DELAY/{waits[k]:.3f}")
    lines += ["INSERT/DEPOSIT OFF"] if on else []
    file.write_text("\n".join([*lines, "FINI"]) + "\n", encoding="utf-8")

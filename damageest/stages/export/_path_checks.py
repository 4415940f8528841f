"""Checks what a job says for the files of its paths, before these are planned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damageest.errors import JobError, StageError
from damageest.stages.export import PathSettings, PathWriter

if TYPE_CHECKING:
    from damageest.stages.export.files import Files

Faults = list[tuple[tuple[str | int, ...], str]]


def check_paths(files: Files, planner: Any, writers: Mapping[str, PathWriter]) -> Faults:
    """What the writers of ``files.paths`` refuse, each with its place among the options: the machine, or the formats.
    What several formats refuse in the same words is one fault. ``planner``: the job's stage `path`; nothing is checked
    where it plans none and the job names no machine."""
    plans = planner is not None and planner.use != "none"
    if not plans and files.machine is None:
        return []
    channels: Sequence[str] = planner.list_channels() if plans else ()
    found, texts = _read_templates(files)
    settings = PathSettings(
        "mm", "check", texts.get("path_header"), texts.get("path_footer"), files.path_options, machine=files.machine
    )
    said: dict[str, list[str]] = {}
    for name in files.paths:
        check = writers[name].check if name in writers else None
        if check is None:
            continue
        try:
            check(settings, channels)
        except JobError as error:
            said.setdefault("; ".join(error.lines()), []).append(name)
        except StageError as error:
            text = f"{error.message}; {error.remedy}" if error.remedy else error.message
            said.setdefault(text.replace("\n", "; "), []).append(name)
    place = ("machine",) if files.machine is not None else ("paths",)
    for text, names in said.items():
        head = "" if text.startswith(names[0]) else f"{', '.join(names)}: "
        found.append((place, head + text))
    return found


def _read_templates(files: Files) -> tuple[Faults, dict[str, str]]:
    faults, texts = Faults(), dict[str, str]()
    for name in ("path_header", "path_footer"):
        path: Path | None = getattr(files, name)
        try:
            if path is not None and path.is_file():  # that there is none is said by the job's own check
                texts[name] = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            why = "it is no text in UTF-8" if isinstance(error, UnicodeDecodeError) else error.strerror
            faults.append(((name,), f"{path} cannot be read: {why}; give a text file with lines of G-code"))
    return faults, texts

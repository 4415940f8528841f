"""Checks what a job says for the files of its paths, before these are planned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from damageest.errors import JobError, StageError
from damageest.stages.export import PathSettings, PathWriter

Faults = list[tuple[tuple[str | int, ...], str]]


def check_paths(
    names: Sequence[str],
    settings: PathSettings,
    templates: Mapping[str, Path | None],
    planner: Any,
    writers: Mapping[str, PathWriter],
) -> Faults:
    """What the writers of the formats ``names`` refuse, each with its place among the options: the machine, or the
    formats. What several formats refuse in the same words is one fault. ``templates``: files by the option that names
    them. ``planner``: the job's stage `path`; nothing is checked where it plans none and the job names no machine."""
    plans = planner is not None and planner.plans_paths
    if not plans and settings.machine is None:
        return []
    channels: Sequence[str] = planner.list_channels() if plans else ()
    said: dict[str, list[str]] = {}
    for name in names:
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
    found = _check_templates(templates)
    place = ("machine",) if settings.machine is not None else ("paths",)
    for text, refused in said.items():
        head = "" if text.startswith(refused[0]) else f"{', '.join(refused)}: "
        found.append((place, head + text))
    return found


def _check_templates(templates: Mapping[str, Path | None]) -> Faults:
    faults = Faults()
    for name, path in templates.items():
        try:
            if path is not None and path.is_file():  # that there is none is said by the job's own check
                path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            why = "it is no text in UTF-8" if isinstance(error, UnicodeDecodeError) else error.strerror
            faults.append(((name,), f"{path} cannot be read: {why}; give a text file with lines of G-code"))
    return faults

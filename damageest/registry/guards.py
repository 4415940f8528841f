"""Calls of functions that plugins bring beside their stages: where one fails, the error says whose it is."""

from __future__ import annotations

import errno
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import (
    DamageestError,
    StageError,
    clean_message,
    describe_missing_library,
    describe_shortage,
    is_interrupt,
)
from damageest.isolation import at_work
from damageest.stages.export import ExportedFiles, PathWriter, Writer

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
"""Errors of the system for which no writer is to blame."""


def guard_writer(name: str, writer: Writer, owner: str) -> Writer:
    """The writer of a format with each of its functions guarded. ``owner``: whose it is, with its version."""
    guard = partial(_guard, name, owner, "damageest_writers")
    return replace(
        writer,
        write=guard("write", writer.write, _check_files),
        exact=guard("exact", writer.exact, _check_files),
        document=guard("document", writer.document, _check_files),
        patch=guard("patch", writer.patch, _check_note),
    )


def guard_path_writer(name: str, writer: PathWriter, owner: str) -> PathWriter:
    """The same for a format of paths."""
    guard = partial(_guard, name, owner, "damageest_path_writers")
    return replace(
        writer,
        write=guard("write", writer.write, _check_path_notes),
        check=guard("check", writer.check, lambda given, folder: ""),
    )


def guard_conversion(name: str, convert: Callable[..., Any], owner: str) -> Callable[..., Any]:
    """The same for what a result can be converted to. A ValueError may be the caller's."""
    return partial(_convert, convert, f"the conversion '{name}' of {owner} ({_name_function(convert)})", owner)


def _convert(convert: Callable[..., Any], called: str, owner: str, *values: Any) -> Any:
    try:
        return convert(*values)
    except (DamageestError, ValueError):
        raise
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        if known := describe_missing_library(error) or describe_shortage(error):
            raise StageError(f"{called}: {known.message}", known.remedy, code=known.code) from error
        text = f"{called} failed: {type(error).__name__}: {clean_message(error, 400)}"
        raise StageError(text, f"report it to the authors of {owner}", code="faulty") from error


def name_guarded(function: Any) -> str:
    """What a function of a plugin's writer is called in messages; empty for one of damageest's own."""
    is_guarded = isinstance(function, partial) and function.func is _call
    return f"the writer {function.args[2]}" if is_guarded else ""


def _guard(name: str, owner: str, hook: str, what: str, function: Any, check: Callable[[Any, Path], str]) -> Any:
    if function is None:
        return None
    called = f"'{name}' of {owner} ({_name_function(function)}, its `{what}`, from the hook {hook})"
    return partial(_call, function, check, called, owner)


def _name_function(function: Any) -> str:
    inner = getattr(function, "func", function)
    title = getattr(inner, "__qualname__", type(inner).__qualname__)
    return f"{getattr(inner, '__module__', type(inner).__module__)}.{title}"


def _call(function: Any, check: Callable[[Any, Path], str], called: str, owner: str, *values: Any, **named: Any) -> Any:
    remedy = f"another format; report it to the authors of {owner}"
    try:
        with at_work(f"the writer {called}", owner=owner):
            given = function(*values, **named)
    except DamageestError:
        raise
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        if describe_shortage(error) or (isinstance(error, OSError) and error.errno in FULL):
            raise
        text = f"the writer {called} failed: {type(error).__name__}: {clean_message(error, 400)}"
        raise StageError(text, remedy, code="faulty") from error
    folder = values[0] if values and isinstance(values[0], Path) else Path()
    if wrong := check(given, folder):
        raise StageError(f"the writer {called} {wrong}", remedy, code="faulty")
    return given


def _check_files(given: Any, folder: Path) -> str:
    """What is wrong with what a writer of solids or of a document gave; empty where nothing is."""
    if not isinstance(given, ExportedFiles):
        return f"gave a {type(given).__name__}, and has to give an ExportedFiles"
    for name in given.files:
        if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts:
            return f"gave the file {name!r}, and has to give paths relative to its folder"
        if not (folder / name).is_file():
            return f"says that it wrote {name}, and there is no such file"
    return ""


def _check_note(given: Any, folder: Path) -> str:
    return "" if given is None or isinstance(given, str) else f"gave a {type(given).__name__}, and has to give a text"


def _check_path_notes(given: Any, folder: Path) -> str:
    if given is None or (isinstance(given, Sequence) and all(isinstance(note, str) for note in given)):
        return ""
    return f"gave a {type(given).__name__}, and has to give a sequence of notes, or None"


def name_observer(hook: Any, error: BaseException) -> str:
    """The package, or the class, of the observer that an error came through."""
    codes = {frame.f_code for frame, _ in traceback.walk_tb(error.__traceback__)}
    found = [each for each in hook.get_hookimpls() if getattr(each.function, "__code__", None) in codes]
    package, colon, _ = found[0].plugin_name.partition(":") if found else ("an observer", ":", "")
    return package if colon else f"the observer {type(found[0].plugin).__name__}"


def compute_joints(hook: Any, machine: str, poses: Floats, turns: Floats) -> Floats | None:
    """What the first plugin that knows a robot gives by the hook damageest_kinematics; None where none does.

    Raises StageError that names the plugin where it fails, or gives what are no joints (N,J) of the poses (N,4,4).
    """
    try:
        found = hook(machine=machine, poses=poses, turns=turns)
    except DamageestError:
        raise
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        who = name_observer(hook, error)
        text = f"{who} failed in its hook damageest_kinematics for '{machine}': {type(error).__name__}: "
        raise StageError(
            text + clean_message(error, 400), f"report it to the authors of {who}", code="faulty"
        ) from error
    if found is None:
        return None
    try:
        joints = np.asarray(found, float)
    except (TypeError, ValueError):
        joints = np.zeros(0)
    if joints.ndim != 2 or len(joints) != len(poses):
        told = f"{joints.shape} joints" if joints.size else f"a {type(found).__name__} that holds no joints"
        text = f"the hook damageest_kinematics gave {told} for {len(poses)} poses of '{machine}'"
        raise StageError(text, "report it to the authors of the plugin for this robot", code="faulty")
    return joints

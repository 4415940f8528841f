"""The writers by name. Their modules, and scipy with them, are imported when a file is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from damageest.stages.export import PathSettings, PathWriter

if TYPE_CHECKING:
    from damageest.artefacts import DepositPath, Floats

DIALECTS = {
    "krl": ("krl", "Krl", "src"),
    "rapid": ("rapid", "Rapid", "mod"),
    "fanuc": ("fanuc", "Fanuc", "ls"),
    "sinumerik": ("sinumerik", "Sinumerik", "mpf"),
    "heidenhain": ("heidenhain", "Heidenhain", "h"),
    "linuxcnc": ("linuxcnc", "LinuxCnc", "linuxcnc.ngc"),
}
"""Name of the format, to module and class, and the suffix of its files."""


def list_writers() -> Mapping[str, PathWriter]:
    """One for each dialect, and json."""
    writers = {
        name: PathWriter(partial(_write, module, cls), suffix, partial(_check, module, cls), _find_reach)
        for name, (module, cls, suffix) in DIALECTS.items()
    }
    return writers | {"json": PathWriter(_write_json, "json", _check_json, _find_reach)}


def _find_reach(settings: PathSettings) -> Floats | None:
    from damageest_machines.files import find_file, read_machine
    from damageest_machines.reach import find_reach

    return None if settings.machine is None else find_reach(read_machine(find_file(settings.machine)))


def _check(module: str, cls: str, settings: PathSettings, channels: Sequence[str]) -> None:
    from damageest_machines.post import make_writer

    check = make_writer(getattr(import_module(f"damageest_machines.writers.{module}"), cls)).check
    assert check is not None
    check(settings, channels)


def _check_json(settings: PathSettings, channels: Sequence[str]) -> None:
    if settings.machine is not None:
        from damageest_machines.build import check_machine
        from damageest_machines.files import find_file, read_machine

        check_machine(read_machine(find_file(settings.machine)), channels)


def _write(module: str, cls: str, file: Path, path: DepositPath, settings: PathSettings) -> Sequence[str] | None:
    from damageest_machines.post import make_writer

    post = getattr(import_module(f"damageest_machines.writers.{module}"), cls)
    return make_writer(post).write(file, path, settings)


def _write_json(file: Path, path: DepositPath, settings: PathSettings) -> Sequence[str] | None:
    from damageest_machines.json_file import write_json

    return write_json(file, path, settings)

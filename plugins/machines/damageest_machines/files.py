"""Reads machine files; finds those that the package brings."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from damageest.errors import StageError, suggest
from damageest.job.yamlfile import read
from damageest_machines.definition import Machine

SHIPPED = Path(__file__).parent / "shipped"


def list_shipped() -> dict[str, Path]:
    """The machine files of the package, by the name that a job calls them by."""
    return {file.stem: file for file in sorted(SHIPPED.glob("*.yaml"))}


def find_file(machine: Path | str | None) -> Path:
    """The file that a job means: one beside it, or one of the package. Raises StageError where there is none."""
    shipped = list_shipped()
    known = f"the package has {', '.join(shipped)}"
    if machine is None:
        raise StageError("the format needs a machine", f"export.machine: a file, or a name; {known}")
    if isinstance(machine, Path) and machine.is_file():
        return machine
    if str(machine) in shipped:
        return shipped[str(machine)]
    raise StageError(
        f"there is no machine '{machine}'{suggest(str(machine), list(shipped))}",
        f"{known}; or give a file, for example mine.yaml",
    )


def read_machine(file: Path) -> Machine:
    """The machine that a file defines. Raises JobError for a file that cannot be read, StageError for one that is
    wrong, with each fault."""
    return _read(file, file.stat().st_mtime_ns)


@cache
def _read(file: Path, changed: int) -> Machine:
    values, positions = read(file)
    if not isinstance(values, Mapping):
        raise StageError(f"{file.name}: a machine file is a mapping with at least name and process", _REMEDY)
    try:
        return Machine.model_validate(values)
    except ValidationError as error:
        raise StageError("\n".join(_describe(file, fault, positions) for fault in error.errors()), _REMEDY) from None


_REMEDY = "damageest machine schema shows what a machine file may say, damageest machine check FILE checks it"


def _describe(file: Path, fault: Any, positions: Any) -> str:
    place = tuple(fault["loc"])
    line = next((positions[place[:k]][0] for k in range(len(place), 0, -1) if place[:k] in positions), 1)
    words = ".".join(map(str, place))
    text = fault["msg"].removeprefix("Value error, ")
    return f"{file.name}:{line}: {words + ': ' if words else ''}{text}"

"""Results as QIF 3.0 documents (ISO 23952), the format in which measuring programs exchange features and deviations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from damageest import hookimpl

if TYPE_CHECKING:
    from damageest.result import Result
    from damageest.stages.export import Body, ExportedFiles, Writer


@hookimpl
def damageest_writers() -> Mapping[str, Writer]:
    """QIF, one document of the whole result."""
    from damageest.stages.export import Writer

    return {"qif": Writer(_write_no_solid, document=_write_document)}


def _write_no_solid(folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    """A solid without the result that it belongs to is no QIF document."""
    from damageest.stages.export import ExportedFiles

    return ExportedFiles(notes=(f"{stem} was not written as QIF, which holds the result as a whole",))


def _write_document(folder: Path, result: Result) -> ExportedFiles:
    from damageest_qif.document import write_document

    return write_document(folder, result)

"""`damageest verify`: checks that an output folder is as the run left it, and that a repeated run gives the same."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with
from damageest.cli._streams import say


def command(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of a run.")],
    rerun: Annotated[bool, typer.Option("--rerun", help="Repeat the run in another folder and compare.")] = False,
    as_json: AsJson = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Check an output folder by the hashes in its result.json. Covers files and inputs."""
    end_with(lambda: _check(folder, rerun, as_json), as_json)


def _check(folder: Path, rerun: bool, as_json: bool) -> int:
    """Prints what changed, and gives the exit status."""
    from damageest.output.folder import open_output
    from damageest.output.verification import find_changes, find_other_versions

    content = open_output(folder).content
    changes = find_changes(folder, content)
    for text in changes:
        say(f"error: {text}", err=True)
    others = find_other_versions(content)
    for text in others:
        say(f"note: {text}")
    count, inputs = (len(content["provenance"][kind]) for kind in ("outputs", "inputs"))
    if not changes:
        say(f"{folder}: result.json, {count} files and {inputs} inputs are as the run left them")
    differences = _run_again(folder, content) if rerun else []
    if as_json:
        told = {"folder": folder, "changes": changes, "other_versions": others, "files": count, "inputs": inputs}
        say_json({**told, "differences": differences if rerun else None})
    changes += differences
    return 1 if changes else 0


def _run_again(folder: Path, content: dict[str, object]) -> list[str]:
    """The differences of a repeated run, as sentences; also printed."""
    import tempfile
    from typing import Any

    from damageest.api import run
    from damageest.errors import InputError
    from damageest.job import load
    from damageest.output.folder import open_output
    from damageest.output.verification import find_differences, read_provenance
    from damageest.registry import Registry

    provenance: dict[str, Any] = read_provenance(folder, content)
    if provenance["given"]:
        raise InputError(
            f"{folder}: {' and '.join(provenance['given'])} were arrays and no files; repeat the run from Python"
        )
    registry = Registry.discover()
    job = load(provenance["job"], registry, folder=folder)
    with tempfile.TemporaryDirectory(prefix="damageest-verify-") as place:
        run(job, output=Path(place) / "out", registry=registry)
        differences = find_differences(content, open_output(Path(place) / "out").content)
    for text in differences:
        say(f"error: {text}", err=True)
    if not differences:
        say(f"{folder}: a repeated run gives the same")
    return differences

"""Compares an output folder with what its result.json says of it, and two results with each other."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest.io.files import file_sha256
from damageest.output.provenance import describe_system, list_packages, seal

DATED = ("job.yaml", "report.html")
"""Files that are not compared after a repeated run: they contain paths, the report its date as well."""


def read_provenance(folder: Path, content: Mapping[str, Any]) -> dict[str, Any]:
    """The provenance of a result. Raises InputError where it has none."""
    found = content.get("provenance")
    if not isinstance(found, dict):
        raise InputError(
            f"{folder}/result.json has no provenance: an earlier version wrote it; run the job again",
            code="result_folder",
        )
    return found


def find_changes(folder: Path, content: Mapping[str, Any]) -> list[str]:
    """What no longer agrees with the result: of its own file, the files beside it, and the inputs; as sentences."""
    provenance = read_provenance(folder, content)
    changes = [] if seal(content) == provenance["sha256"] else ["result.json: was changed after it was written"]
    for kind in ("outputs", "inputs"):
        for item in provenance[kind]:
            if text := _compare(folder / item["path"], item["sha256"]):
                name = item["path"] if kind == "outputs" else f"input {item['path']}"
                changes.append(f"{name}: {text}")
    return changes


def _compare(path: Path, sha256: str) -> str:
    try:
        return "" if file_sha256(path) == sha256 else "was changed after the run"
    except OSError as error:
        return f"cannot be read: {error.strerror}"


def find_other_versions(content: Mapping[str, Any]) -> list[str]:
    """Packages and system that differ from those of the result, as text."""
    provenance = content["provenance"]
    here = list_packages(provenance["sources"])
    other = [
        f"{name} was {version}, here it is {here.get(name, 'missing')}"
        for name, version in provenance["packages"].items()
        if here.get(name) != version
    ]
    if provenance["system"] != describe_system():
        other.append(f"the system was {provenance['system']}, here it is {describe_system()}")
    return other


def find_differences(first: Mapping[str, Any], second: Mapping[str, Any]) -> list[str]:
    """Differences of two results as text: values of their content, and files. Times, paths and reuse of earlier runs
    are not compared."""
    found = _differ(_strip(first), _strip(second), "")
    before, after = ({item["path"]: item["sha256"] for item in one["provenance"]["outputs"]} for one in (first, second))
    for name in sorted({*before, *after} - set(DATED)):
        if name not in after:
            found.append(f"{name}: the repeated run does not write it")
        elif name not in before:
            found.append(f"{name}: only the repeated run writes it")
        elif before[name] != after[name]:
            found.append(f"{name}: differs in the repeated run")
    return found


def _strip(content: Mapping[str, Any]) -> dict[str, Any]:
    left = {key: value for key, value in content.items() if key not in ("stages", "steps", "provenance", "versions")}
    left["part"] = {key: value for key, value in content["part"].items() if key != "path"}
    left["scan"] = {key: value for key, value in content["scan"].items() if key != "paths"}
    return left


def _differ(first: Any, second: Any, place: str) -> list[str]:
    if isinstance(first, dict) and isinstance(second, dict):
        keys = dict.fromkeys([*first, *second])
        return [text for key in keys for text in _differ(first.get(key), second.get(key), f"{place}.{key}".strip("."))]
    if isinstance(first, list) and isinstance(second, list) and len(first) == len(second):
        pairs = enumerate(zip(first, second, strict=True))
        return [text for index, pair in pairs for text in _differ(*pair, f"{place}.{index}")]
    return [] if first == second else [f"{place}: was {str(first)[:80]}, and is {str(second)[:80]} in the repeated run"]

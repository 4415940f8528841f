"""What a result was made from and with: enough to repeat the run, and to notice a change of any file."""

from __future__ import annotations

import functools
import hashlib
import json
import platform
import re
from collections.abc import Iterable, Mapping
from email.parser import HeaderParser
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from pydantic import Field

from damageest.artefacts import Part, Scan
from damageest.io.files import file_sha256
from damageest.job.model import Job, find_paths, to_plain
from damageest.output.base import JsonModel


class FileReport(JsonModel):
    path: str = Field(description="relative to this file")
    bytes: int
    sha256: str = Field(description="empty where the file was gone when the result was written")


class ProvenanceReport(JsonModel):
    """What the result was made from and with."""

    job: dict[str, Any] = Field(
        description="the job as it ran, with every default and seed; paths relative to this file"
    )
    inputs: list[FileReport] = Field(description="every file that the job names")
    given: dict[str, str] = Field(description="SHA-256 of part and scan where they were arrays and no files")
    outputs: list[FileReport] = Field(description="every file of the result but this one and the kept stages")
    packages: dict[str, str] = Field(description="versions of the packages that provide stages, and of all they need")
    sources: dict[str, str] = Field(description="SHA-256 of the source code of the packages that provide stages")
    system: str = Field(description="system, processor and Python")
    sha256: str = Field(description="SHA-256 of this file's content without this value, the stages and the steps")


def build_provenance(job: Job, folder: Path, target: Path) -> dict[str, Any]:
    """The provenance of a result whose files are in ``folder`` and will stand in ``target``; without its own hash."""
    outputs = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "result.json")
    providers = {item.provider.name: item.provider for item in job.implementations.values()}
    paths = dict.fromkeys(path for stage in job.stages.values() for _, path in find_paths(stage.model_dump()))
    return ProvenanceReport(
        job=job.to_values(target),
        inputs=[_describe_file(path, to_plain(path, target)) for path in paths],
        given={contract.stage: _hash_arrays(value) for contract, value in job.given.items()},
        outputs=[_describe_file(path, path.relative_to(folder).as_posix()) for path in outputs],
        packages=list_packages(providers),
        sources={name: provider.fingerprint for name, provider in sorted(providers.items())},
        system=describe_system(),
        sha256="",
    ).model_dump(mode="json", by_alias=True)


def describe_system() -> str:
    """System, processor and Python in one line."""
    return f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"


def seal(content: Mapping[str, Any]) -> str:
    """SHA-256 of a result's content without this hash, and without stages and steps, whose seconds differ in each
    run."""
    bare = {**content, "stages": [], "provenance": {**content["provenance"], "sha256": ""}}
    bare.pop("steps", None)
    return hashlib.sha256(json.dumps(bare, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def list_packages(names: Iterable[str]) -> dict[str, str]:
    """Versions of the named packages and of all that they need, directly or not, by name. What an installation leaves
    out, such as extras, is not listed."""
    return dict(_list_once(tuple(sorted(names))))


@functools.cache
def _list_once(names: tuple[str, ...]) -> dict[str, str]:
    found: dict[str, str] = {}
    open_names = list(names)
    while open_names:
        name = re.sub(r"[-_.]+", "-", open_names.pop()).lower()
        if name in found:
            continue
        try:
            package = distribution(name)
        except PackageNotFoundError:
            continue
        # the head alone: to parse the description of a hundred packages takes half a second
        head = HeaderParser().parsestr((package.read_text("METADATA") or "").split("\n\n", 1)[0])
        found[name] = head["Version"] or package.version
        needed = [text for text in head.get_all("Requires-Dist") or [] if "extra ==" not in text]
        open_names += [match[0] for text in needed if (match := re.match(r"[\w.-]+", text))]
    return dict(sorted(found.items()))


def _describe_file(path: Path, name: str) -> FileReport:
    try:
        return FileReport(path=name, bytes=path.stat().st_size, sha256=file_sha256(path))
    except OSError:
        return FileReport(path=name, bytes=0, sha256="")


def _hash_arrays(value: Part | Scan) -> str:
    total = hashlib.sha256()
    for array in (value.vertices, value.faces) if isinstance(value, Part) else (value.points, value.normals):
        if array is not None:
            total.update(f"{array.dtype}{array.shape}".encode() + array.tobytes())
    return total.hexdigest()

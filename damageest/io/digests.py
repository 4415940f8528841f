"""The digest of values: of text, numbers, arrays, artefacts and the content of files."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from damageest.io.files import file_sha256


def digest(*parts: object) -> str:
    """A short SHA-256 over the parts' text; arrays count by their bytes, paths by their files' content."""
    total = hashlib.sha256()
    for part in parts:
        _feed(total, part)
        total.update(b"\x00")
    return total.hexdigest()[:24]


def _feed(total: hashlib._Hash, part: object) -> None:
    """Adds a part to a hash. Arrays are not copied: a scan of ten million points has 240 MB."""
    if isinstance(part, np.ndarray):
        total.update(f"{part.dtype}{part.shape}".encode())
        total.update(np.ascontiguousarray(part).reshape(-1).view(np.uint8).data)
    elif isinstance(part, np.generic):  # which the cache gives back as a number of Python
        _feed(total, part.item())
    elif isinstance(part, Path):
        total.update(file_sha256(part).encode() if part.is_file() else str(part).encode())
    elif isinstance(part, (Mapping, list, tuple)):
        total.update(b"{" if isinstance(part, Mapping) else b"[")
        for item in part.items() if isinstance(part, Mapping) else part:
            _feed(total, item)
            total.update(b",")
        total.update(b"]")
    elif dataclasses.is_dataclass(part) and not isinstance(part, type):
        _feed(total, [getattr(part, f.name) for f in dataclasses.fields(part)])
    else:
        total.update(repr(part).encode())

"""Values of damageest as files: arrays as .npz and the rest as JSON, never pickle, so that no file can run code."""

from __future__ import annotations

import dataclasses
import importlib
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from damageest.errors import InputError

ARRAYS, REST = "result.npz", "result-values.json"


def keep_value(folder: Path, value: Any, left_out: tuple[str, ...] = ()) -> None:
    """Writes a dataclass of damageest without its fields ``left_out``. Raises TypeError for a value that cannot be
    kept."""
    arrays: dict[str, Any] = {}
    rest = _encode(value, arrays, left_out)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / ARRAYS, **arrays)
    (folder / REST).write_text(json.dumps(rest), encoding="utf-8")


def read_value(folder: Path, kind: type) -> Any:
    """The value that was kept in a folder. Raises InputError where there is none of that kind."""
    try:
        rest = json.loads((folder / REST).read_text(encoding="utf-8"))
        with np.load(folder / ARRAYS, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        value = _decode(rest, arrays)
    except (OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise InputError(f"{folder}: holds no result that was saved: {error}; save it with Result.save") from error
    if not isinstance(value, kind):
        raise InputError(f"{folder}: holds a {type(value).__name__}, not a {kind.__name__}")
    return value


def _encode(value: Any, arrays: dict[str, Any], left_out: tuple[str, ...] = ()) -> Any:
    if isinstance(value, np.ndarray):
        arrays[f"a{len(arrays)}"] = value
        return {"array": f"a{len(arrays) - 1}"}
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, tuple):
        return {"tuple": [_encode(item, arrays) for item in value]}
    if isinstance(value, list):
        return {"list": [_encode(item, arrays) for item in value]}
    if isinstance(value, Mapping):
        return {"mapping": [[_encode(key, arrays), _encode(item, arrays)] for key, item in value.items()]}
    if isinstance(value, Path):
        return {"path": str(value)}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kind, names = type(value), [one.name for one in dataclasses.fields(value) if one.init]
        fields = {name: _encode(getattr(value, name), arrays) for name in names if name not in left_out}
        return {"kind": f"{kind.__module__}:{kind.__qualname__}", "fields": fields}
    raise TypeError(f"a {type(value).__name__} cannot be kept")


def _decode(value: Any, arrays: Mapping[str, Any]) -> Any:
    if not isinstance(value, dict):
        return value
    ((first, content), *_) = value.items()
    match first:
        case "array":
            return arrays[content]
        case "tuple":
            return tuple(_decode(item, arrays) for item in content)
        case "list":
            return [_decode(item, arrays) for item in content]
        case "mapping":
            return {_decode(key, arrays): _decode(item, arrays) for key, item in content}
        case "path":
            return Path(content)
    module, _, name = content.partition(":")
    if not module.startswith("damageest."):
        raise ValueError(f"{content} is no value of damageest")
    kind: Any = getattr(importlib.import_module(module), name)
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        raise ValueError(f"{content} is no value of damageest")
    return kind(**{key: _decode(item, arrays) for key, item in value["fields"].items()})

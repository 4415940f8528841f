"""damageest: from a CAD part and a 3D scan of the damaged one to the watertight volume of the missing metal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "1.0.0rc1"

if TYPE_CHECKING:
    from damageest.api import run as run
    from damageest.batches.run import batch as batch
    from damageest.job import Job as Job
    from damageest.pipeline.placing.prepare import read_inputs as read_inputs
    from damageest.pipeline.placing.prepare import read_part as read_part
    from damageest.pipeline.watch import MemoryCache as MemoryCache
    from damageest.pipeline.watch import Progress as Progress
    from damageest.registry import Registry as Registry
    from damageest.registry.hookspecs import hookimpl as hookimpl
    from damageest.result import Result as Result

_PUBLIC = {
    "batch": "damageest.batches.run",
    "run": "damageest.api",
    "hookimpl": "damageest.registry.hookspecs",
    "Job": "damageest.job",
    "read_inputs": "damageest.pipeline.placing.prepare",
    "read_part": "damageest.pipeline.placing.prepare",
    "MemoryCache": "damageest.pipeline.watch",
    "Progress": "damageest.pipeline.watch",
    "Registry": "damageest.registry",
    "Result": "damageest.result",
}
__all__ = [
    "Job",
    "MemoryCache",
    "Progress",
    "Registry",
    "Result",
    "__version__",
    "batch",
    "hookimpl",
    "read_inputs",
    "read_part",
    "run",
]


def __dir__() -> list[str]:
    """The public names too, which are imported when they are first used."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used, so that the command line starts quickly."""
    if name in _PUBLIC:
        import importlib

        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'damageest' has no attribute '{name}'")

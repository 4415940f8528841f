"""What every stage implementation has in common.

An implementation is a frozen pydantic model: its fields are the options that a job may set, its ``run`` the behaviour.
Each stage's contract lives in ``damageest/stages/<stage>/__init__.py``; what ``run`` may ask for is named there.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo

from damageest.errors import PluginError


def _beside_job(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder")
    return (Path(folder) / path.expanduser()).resolve() if folder is not None else path


JobPath = Annotated[Path, AfterValidator(_beside_job)]
"""A path option: relative to the job file's folder, absolute once the job is checked."""


class Stage(BaseModel):
    """Base of all contracts. ``stage``: its name in a job; ``takes``: what ``run`` may ask for, parameter
    name to type;
    ``gives``: the name under which later stages find the result. ``reads``: suffixes of the files that
    a reader of part or scan takes."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")
    stage: ClassVar[str] = ""
    takes: ClassVar[Mapping[str, object]] = {}
    gives: ClassVar[str] = ""
    reads: ClassVar[tuple[str, ...]] = ()

    use: str

    @classmethod
    def needs(cls) -> tuple[str, ...]:
        """The parameter names of ``run``, checked against the contract.

        Raises PluginError where ``run`` is missing or asks for what the contract does not give.
        """
        run: Any = getattr(cls, "run", None)
        if run is None or getattr(run, "__isabstractmethod__", False):
            raise PluginError(f"{cls.__module__}.{cls.__qualname__} has no run method")
        parameters = list(inspect.signature(run).parameters.values())[1:]
        if any(p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD, p.POSITIONAL_ONLY) for p in parameters):
            raise PluginError(
                f"{cls.__module__}.{cls.__qualname__}.run has to name what it needs, without *args, **kwargs or '/'; "
                f"it may ask for: {', '.join(sorted(cls.takes))}"
            )
        names = tuple(p.name for p in parameters)
        unknown = [name for name in names if name not in cls.takes]
        if unknown:
            raise PluginError(
                f"{cls.__module__}.{cls.__qualname__}.run asks for {', '.join(map(repr, unknown))}, which stage "
                f"'{cls.stage}' does not give; it may ask for: {', '.join(sorted(cls.takes))}"
            )
        return names

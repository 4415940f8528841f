"""What every stage implementation has in common.

An implementation is a frozen pydantic model: its fields are the options that a job may set, its ``run`` does the work.
Each stage's contract is in ``damageest/stages/<stage>/__init__.py``. The parameters of the contract's ``run`` are what
an implementation may ask for: it names those that it needs.
"""

from __future__ import annotations

import inspect
import sys
import types
import typing
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo

from damageest.errors import PluginError
from damageest.io.files import expand_home

Given = TypeVar("Given")


def asked_by_name(run: Callable[..., Given]) -> Callable[..., Given]:
    """Marks the ``run`` of a contract. An implementation may ask for some of the parameters: the engine passes them by
    name, and type checkers compare the return type alone. `Stage.needs` compares the parameters."""
    return run


def _resolve_beside_job(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder")
    return (Path(folder) / expand_home(path)).resolve() if folder is not None else path


JobPath = Annotated[Path, AfterValidator(_resolve_beside_job)]
"""A path option: relative to the job file's folder, absolute once the job is checked."""


class Stage(BaseModel):
    """Base of all contracts.

    A contract says ``stage``: its name in a job; ``gives``: the name under which later stages find the result;
    ``per_site``: whether it runs once for each site, or once per job. ``reads``: suffixes of the files that a reader
    of part or scan takes.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")
    stage: ClassVar[str] = ""
    gives: ClassVar[str] = ""
    per_site: ClassVar[bool] = False
    reads: ClassVar[tuple[str, ...]] = ()

    use: str

    @classmethod
    def takes(cls) -> Mapping[str, Any]:
        """What ``run`` may ask for: name and type of each parameter of the contract's ``run``."""
        return {name: kind for name, kind in _read_hints(_find_contract(cls)).items() if name != "return"}

    @classmethod
    def gives_type(cls) -> Any:
        """The type that the contract's ``run`` gives."""
        return _read_hints(_find_contract(cls))["return"]

    @classmethod
    def needs(cls) -> tuple[str, ...]:
        """The parameter names of ``run``, checked against the contract: names and types.

        Raises PluginError where ``run`` is missing, asks for what the contract does not give, or declares other types.
        """
        run: Any = getattr(cls, "run", None)
        if run is None or getattr(run, "__isabstractmethod__", False):
            raise PluginError(f"{_name(cls)} has no run method")
        parameters = list(inspect.signature(run).parameters.values())[1:]
        valid = f"it may ask for: {', '.join(_show(*item) for item in sorted(cls.takes().items()))}"
        if any(p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD, p.POSITIONAL_ONLY) for p in parameters):
            raise PluginError(f"{_name(cls)}.run has to name what it needs, without *args, **kwargs or '/'; {valid}")
        names = tuple(p.name for p in parameters)
        unknown = [name for name in names if name not in cls.takes()]
        if unknown:
            raise PluginError(
                f"{_name(cls)}.run asks for {', '.join(map(repr, unknown))}, which stage '{cls.stage}' does not give; "
                f"{valid}"
            )
        _check_types(cls, names)
        return names


def _find_contract(cls: type[Stage]) -> type[Stage]:
    """The class that declares what is given: the contract of an implementation."""
    return next(kind for kind in cls.__mro__ if issubclass(kind, Stage) and "gives" in vars(kind))


@cache
def _read_hints(cls: type[Stage]) -> Mapping[str, Any]:
    """Types of the parameters of ``run`` and of what it returns. Names that an implementation imports for type checkers
    alone are looked up among the artefacts and in its contract's module."""
    run: Any = cls.run  # type: ignore[attr-defined]
    try:
        return typing.get_type_hints(run)
    except NameError:
        from damageest import artefacts

        known = vars(artefacts) | vars(sys.modules[_find_contract(cls).__module__])
        return typing.get_type_hints(run, localns=known)


def _check_types(cls: type[Stage], names: tuple[str, ...]) -> None:
    """Raises PluginError where a parameter does not accept what the contract gives, or the result is another type."""
    try:
        declared = _read_hints(cls)
    except (NameError, TypeError, AttributeError) as error:
        raise PluginError(
            f"{_name(cls)}.run: its types cannot be read ({error}); import them outside of 'if TYPE_CHECKING'"
        ) from None
    for name in names:
        if name in declared and not _accepts(declared[name], cls.takes()[name]):
            raise PluginError(
                f"{_name(cls)}.run declares {_show(name, declared[name])}; stage '{cls.stage}' gives "
                f"{_show(name, cls.takes()[name])}"
            )
    if "return" in declared and not _accepts(cls.gives_type(), declared["return"]):
        raise PluginError(
            f"{_name(cls)}.run declares that it returns {_text(declared['return'])}; stage '{cls.stage}' has to give "
            f"{_text(cls.gives_type())}"
        )


def _accepts(wanted: Any, given: Any) -> bool:
    """Whether each value of type ``given`` is one of type ``wanted``, as far as the annotations tell."""
    if wanted in (Any, object) or given is Any or wanted == given:
        return True
    if _is_union(given):
        return all(_accepts(wanted, kind) for kind in typing.get_args(given))
    if _is_union(wanted):
        return any(_accepts(kind, given) for kind in typing.get_args(wanted))
    outer, inner = typing.get_origin(wanted) or wanted, typing.get_origin(given) or given
    if not (isinstance(outer, type) and isinstance(inner, type)):
        return False
    # A container without its element type accepts any of its kind.
    return issubclass(inner, outer) and (not typing.get_args(wanted) or not typing.get_args(given))


def _is_union(kind: Any) -> bool:
    return typing.get_origin(kind) in (typing.Union, types.UnionType)


def _name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _show(name: str, kind: Any) -> str:
    return f"{name}: {_text(kind)}"


def _text(kind: Any) -> str:
    """A type as one writes it."""
    from damageest import artefacts

    if kind == artefacts.Floats:
        return "Floats"
    if kind is type(None):
        return "None"
    return kind.__name__ if isinstance(kind, type) and not typing.get_args(kind) else str(kind).replace("typing.", "")

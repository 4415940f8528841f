"""The base of all stage implementations.

An implementation is a frozen pydantic model. Its fields are the options that a job may set; its ``run`` does the work.
The contract of a stage is in ``damageest/stages/<stage>/__init__.py``; implementations derive from it. The ``run``
of the contract lists all parameters that are available; the ``run`` of an implementation names those that it needs.
"""

from __future__ import annotations

import glob
import inspect
import re
import sys
import types
import typing
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationInfo

from damageest.errors import PluginError
from damageest.io.files import expand_home, resolve_path
from damageest.options import Options

if TYPE_CHECKING:
    from damageest.artefacts import Part
    from damageest.geometry.selectors import Selector

Given = TypeVar("Given")


def asked_by_name(run: Callable[..., Given]) -> Callable[..., Given]:
    """Marks the ``run`` of a contract.

    An implementation may ask for some of its parameters; the engine passes them by name. So type checkers must compare
    the return type only; `Stage.needs` compares the parameters.
    """
    return run


def _resolve_beside_job(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder")
    return resolve_path(path, Path(folder)) if folder is not None else path


JobPath = Annotated[Path, AfterValidator(_resolve_beside_job)]
"""Type of an option that is a path. A job gives it relative to the job file's folder; the check makes it absolute."""


def _find_files(value: Any, info: ValidationInfo) -> Any:
    """The files that globs among the texts match, beside the job, each once."""
    texts = [value] if isinstance(value, (str, Path)) else value
    if not isinstance(texts, (list, tuple)):
        return value
    folder = Path((info.context or {}).get("folder") or ".")
    found: list[Any] = []
    for text in texts:
        matched = [text]
        if (
            isinstance(text, (str, Path))
            and glob.has_magic(str(text))
            and not resolve_path(Path(text), folder).exists()
        ):
            pattern = str(expand_home(Path(text)))
            matched = sorted(glob.glob(pattern, root_dir=folder, recursive=True))
            if not matched:
                raise ValueError(f"no file matches '{text}'")
        found += matched
    unique = dict.fromkeys(str(one) if isinstance(one, (str, Path)) else one for one in found)
    return tuple(unique)


JobPaths = Annotated[tuple[JobPath, ...], BeforeValidator(_find_files, json_schema_input_type=str | tuple[str, ...])]
"""Type of an option that is a list of paths, or a glob, or a list of both; see `JobPath`."""


class Stage(Options):
    """Base of all contracts.

    A contract sets ``stage``, its name in a job; ``gives``, the name under which later stages get the result; and
    ``per_site``, whether it runs once for each site or once for the job. A reader of part or scan sets ``reads``, the
    suffixes of its files. An implementation sets ``use``, its own name in a job, and ``isolated`` where it calls a
    native library: ``run`` then has a process of its own, and a crash, a hang or a lack of memory there is the error of
    this stage. Its class has to be in a module that can be imported. ``modules``: Python modules that ``run`` imports
    and that may not be installed. ``renamed``: former names of options, each with the one that it has now; a job may
    still use them.
    """

    model_config = ConfigDict(ser_json_inf_nan="strings", defer_build=True)
    stage: ClassVar[str] = ""
    gives: ClassVar[str] = ""
    per_site: ClassVar[bool] = False
    reads: ClassVar[tuple[str, ...]] = ()
    isolated: ClassVar[bool] = False
    modules: ClassVar[tuple[str, ...]] = ()
    renamed: ClassVar[Mapping[str, str]] = {}

    use: str

    def leave_out(self, folder: Path) -> Self:
        """The stage without inputs from ``folder``, which the run writes anew. Raises InputError where a needed input
        is missing then."""
        return self

    def find_selectors(self) -> list[tuple[tuple[str | int, ...], Selector]]:
        """The selectors of skin among the options, each with its place below the stage's name in a job."""
        from damageest.geometry.selectors import Selector

        def walk(value: Any, place: tuple[str | int, ...]) -> list[tuple[tuple[str | int, ...], Selector]]:
            if isinstance(value, Selector):
                return [(place, value)]
            items: Any = value.items() if isinstance(value, Mapping) else ()
            items = enumerate(value) if isinstance(value, (list, tuple)) else items
            items = dict(value).items() if isinstance(value, BaseModel) else items
            return [found for step, item in items for found in walk(item, (*place, step))]

        return walk(self, ())

    def find_idle_region(self, selector: Selector, part: Part) -> str:
        """Why a region of space among the options, which selects no skin, has no effect on this part; empty where it
        may have one."""
        return ""

    def find_faults(self, job: Mapping[str, Any], registry: Any) -> list[tuple[tuple[str | int, ...], str]]:
        """Faults of the options in view of the other stages of the ``job``, by name, or of files that they name; each
        with its place below the stage's name. Called before anything is computed. ``registry``: what is installed."""
        return []

    @classmethod
    def takes(cls) -> Mapping[str, Any]:
        """Name and type of each parameter of the contract's ``run``."""
        return {name: kind for name, kind in _read_hints(_find_contract(cls)).items() if name != "return"}

    @classmethod
    def gives_type(cls) -> Any:
        """The type that the contract's ``run`` returns."""
        return _read_hints(_find_contract(cls))["return"]

    @classmethod
    def needs(cls) -> tuple[str, ...]:
        """The names of the parameters of ``run``. Checks names and types against the contract.

        Raises PluginError where ``run`` is missing, asks for a parameter that the contract does not have, or declares
        other types.
        """
        run: Any = getattr(cls, "run", None)
        if run is None or getattr(run, "__isabstractmethod__", False):
            raise PluginError(f"{_name(cls)} has no run method")
        parameters = list(inspect.signature(run).parameters.values())[1:]
        valid = f"it may ask for {', '.join(_show(*item) for item in sorted(cls.takes().items()))}"
        if any(p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD, p.POSITIONAL_ONLY) for p in parameters):
            raise PluginError(f"{_name(cls)}.run must name its parameters, without *args, **kwargs or '/'; {valid}")
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
    """The contract of an implementation: the class that sets ``gives``."""
    return next(kind for kind in cls.__mro__ if issubclass(kind, Stage) and "gives" in vars(kind))


@cache
def _read_hints(cls: type[Stage]) -> Mapping[str, Any]:
    """Types of the parameters of ``run`` and of its result. Names that an implementation imports under TYPE_CHECKING
    are looked up among the artefacts and in its contract's module."""
    run: Any = cls.run  # type: ignore[attr-defined]
    try:
        return typing.get_type_hints(run)
    except NameError:
        from damageest import artefacts

        known = vars(artefacts) | vars(sys.modules[_find_contract(cls).__module__])
        return typing.get_type_hints(run, localns=known)


def _check_types(cls: type[Stage], names: tuple[str, ...]) -> None:
    """Raises PluginError where a parameter does not accept the contract's type, or the result has another type."""
    try:
        declared = _read_hints(cls)
    except (NameError, TypeError, AttributeError) as error:
        raise PluginError(
            f"{_name(cls)}.run: its types cannot be read ({error}); import them outside of 'if TYPE_CHECKING'"
        ) from None
    for name in names:
        if name in declared and not accepts(declared[name], cls.takes()[name]):
            raise PluginError(
                f"{_name(cls)}.run declares {_show(name, declared[name])}; stage '{cls.stage}' gives "
                f"{_show(name, cls.takes()[name])}"
            )
    if "return" in declared and not accepts(cls.gives_type(), declared["return"]):
        raise PluginError(
            f"{_name(cls)}.run declares that it returns {describe_type(declared['return'])}; stage '{cls.stage}' must "
            f"return {describe_type(cls.gives_type())}"
        )


def accepts(wanted: Any, given: Any) -> bool:
    """Whether each value of type ``given`` is one of type ``wanted``, as far as the annotations show."""
    if wanted in (Any, object) or given is Any or wanted == given:
        return True
    if _is_union(given):
        return all(accepts(wanted, kind) for kind in typing.get_args(given))
    if _is_union(wanted):
        return any(accepts(kind, given) for kind in typing.get_args(wanted))
    outer, inner = typing.get_origin(wanted) or wanted, typing.get_origin(given) or given
    if not (isinstance(outer, type) and isinstance(inner, type)):
        return False
    # A container without element types accepts any elements.
    return issubclass(inner, outer) and (not typing.get_args(wanted) or not typing.get_args(given))


def _is_union(kind: Any) -> bool:
    return typing.get_origin(kind) in (typing.Union, types.UnionType)


def _name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _show(name: str, kind: Any) -> str:
    return f"{name}: {describe_type(kind)}"


def describe_type(kind: Any) -> str:
    """A type as it is written in code."""
    from damageest import artefacts

    if kind == artefacts.Floats:
        return "Floats"
    if kind is type(None):
        return "None"
    if isinstance(kind, type) and not typing.get_args(kind):
        return kind.__name__
    # artefacts are imported from their package, not from its modules
    return re.sub(r"\b(damageest\.artefacts\.)\w+\.", r"\1", str(kind).replace("typing.", ""))

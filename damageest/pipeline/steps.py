"""How a step between the contracts is declared: by the names of the values that it takes and gives.

As with the ``run`` of a contract, the parameters of a step are names of values of `JobState`, and ``gives`` names what
it returns::

    @step(gives=("aligned", "warnings"))
    def place_scan(scan: Scan, pose: Pose) -> tuple[Scan, Reasons]: ...

The engine passes the values, writes what the step returns, and makes its keys. A name that `JobState` does not declare,
or another type, is a TypeError on import.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, ParamSpec, TypeVar

from damageest.errors import suggest
from damageest.pipeline.state import MADE_OF, JobState, Value
from damageest.registry.contracts import Contract
from damageest.stages import accepts, describe_type

P = ParamSpec("P")
R = TypeVar("R")

GATHERED = ("failures", "warnings")
"""Values to which a step adds what it gives, unless it takes them: then what it gives is all of them."""


@dataclass(frozen=True, eq=False)
class Step(Generic[P, R]):
    """A function with the names of what it ``takes`` and ``gives``. ``passed``: the names of its parameters.
    ``calls``: the contracts that it calls itself. ``kept``: what it gives is kept in the cache."""

    function: Callable[P, R]
    passed: tuple[str, ...]
    takes: tuple[str, ...]
    gives: tuple[str, ...]
    calls: tuple[Contract, ...] = ()
    kept: bool = False

    @property
    def name(self) -> str:
        return self.function.__name__

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        return self.function(*args, **kwargs)

    def name_values(self, given: Any) -> dict[str, Any]:
        """What the function returned, by name; of a registration its values."""
        values = () if not self.gives else (given,) if len(self.gives) == 1 else given
        named = dict(zip(self.gives, values, strict=True))
        if found := named.pop("registration", None):
            named |= {name: getattr(found, name) for name in MADE_OF["registration"]}
        return named


def step(
    gives: str | tuple[str, ...] = (),
    reads: Sequence[str] = (),
    calls: tuple[Contract, ...] = (),
    kept: bool = False,
) -> Callable[[Callable[P, R]], Step[P, R]]:
    """Declares a step that gives one value or a tuple of values.

    Two parameters are no names of values: ``engine``, and ``state``, a `JobState` with nothing but the values that the
    step takes. A step has them that calls contracts, or that takes many values: it names them in ``reads``. What the
    contracts in ``calls`` take counts as taken. ``kept``: what the step gives is kept in the cache, as that of a stage.
    """
    given = (gives,) if isinstance(gives, str) else gives

    def declare(function: Callable[P, R]) -> Step[P, R]:
        passed = tuple(inspect.signature(function).parameters)
        named = [name for name in passed if name not in ("engine", "state")]
        asked = [name for contract in calls for name in contract.takes() if find_value(name)]
        _check(function, named, reads, given)
        return Step(function, passed, tuple(dict.fromkeys((*named, *reads, *asked))), given, calls, kept)

    return declare


def find_value(name: str) -> Value[Any] | None:
    """The value of a job that has this name."""
    value = getattr(JobState, name, None)
    return value if isinstance(value, Value) else None


def _check(function: Callable[..., Any], named: Sequence[str], reads: Sequence[str], given: tuple[str, ...]) -> None:
    """Raises TypeError where a step names a value that there is not, or declares another type for one."""
    hints = typing.get_type_hints(function)
    kinds = {name: _find_kind(function, name) for name in (*named, *reads, *given)}
    for name in named:
        if not accepts(hints[name], kinds[name]):
            raise TypeError(f"{_where(function)} takes {_show(name, hints[name])}; it is a {_show(name, kinds[name])}")
    if made := [name for name in given if name in MADE_OF and name != "registration"]:
        raise TypeError(f"{_where(function)} gives {made[0]}, which is made of {', '.join(MADE_OF[made[0]])}")
    result = hints["return"]
    is_tuple = typing.get_origin(result) is tuple and len(given) != 1
    returned = typing.get_args(result) if is_tuple else () if result is type(None) else (result,)
    if len(returned) != len(given):
        raise TypeError(
            f"{_where(function)} gives {', '.join(given) or 'nothing'}, but returns {describe_type(result)}"
        )
    for name, kind in zip(given, returned, strict=True):
        if not accepts(kinds[name], kind):
            raise TypeError(f"{_where(function)} gives {_show(name, kind)}; it has to be {_show(name, kinds[name])}")


def _find_kind(function: Callable[..., Any], name: str) -> Any:
    value = find_value(name)
    if value is None:
        names = [name for name in dir(JobState) if find_value(name)]
        raise TypeError(f"{_where(function)} names '{name}', which is no value of a job{suggest(name, names)}")
    return value.kind


def _where(function: Callable[..., Any]) -> str:
    return f"step {function.__module__}.{function.__qualname__}"


def _show(name: str, kind: Any) -> str:
    return f"{name}: {describe_type(kind)}"

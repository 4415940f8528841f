"""`damageest stages`: lists the stages, their implementations and options, and which package provides them."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damageest.cli._json import AsJson, say_json
from damageest.cli._streams import say
from damageest.errors import suggest

if TYPE_CHECKING:
    from damageest.registry import Implementation, Registry


def command(
    stage: Annotated[
        str | None, typer.Argument(help="Show the implementations of one stage, with their options.")
    ] = None,
    name: Annotated[str | None, typer.Argument(help="Show one implementation, with its full description.")] = None,
    as_json: AsJson = False,
) -> None:
    """List stages, their implementations and options."""
    from damageest.errors import Fault, JobError, PluginError
    from damageest.registry import Registry
    from damageest.registry.contracts import STAGES

    registry = Registry.discover()
    if stage is not None and stage not in STAGES:
        raise JobError(
            [Fault(f"there is no stage '{stage}'{suggest(stage, STAGES)}; there are: {', '.join(STAGES)}")], "stages"
        )
    items = {each: registry.of(each) for each in ([stage] if stage else STAGES)}
    if stage and name:
        try:
            items = {stage: (registry.get(stage, name),)}
        except (KeyError, PluginError) as error:
            raise JobError([Fault(str(error.args[0]))], "stages") from None
    if as_json:
        say_json({"stages": [_collect(item) for each in items.values() for item in each]})
        return
    if stage and name:
        _print_implementation(items[stage][0])
        return
    for each in [stage] if stage else STAGES:
        _print_stage(each, registry, with_options=bool(stage))


def _collect(item: Implementation) -> dict[str, Any]:
    """An implementation and its options, for programs."""
    from damageest.registry.contracts import DEFAULTS

    return {
        "stage": item.contract.stage,
        "name": item.name,
        "is_default": DEFAULTS[item.contract] == item.name,
        "description": inspect.getdoc(item.cls) or "",
        "provider": item.provider.name,
        "version": item.provider.version,
        "options": [
            {
                "name": option,
                "description": field.description or "",
                "is_required": field.is_required(),
                "default": None if field.is_required() else field.get_default(call_default_factory=True),
            }
            for option, field in item.cls.model_fields.items()
            if option != "use"
        ],
    }


def _print_stage(stage: str, registry: Registry, with_options: bool) -> None:
    from damageest.registry.contracts import DEFAULTS

    items = registry.of(stage)
    typer.secho(stage, bold=True)
    for item in items:
        default = " (default)" if DEFAULTS[item.contract] == item.name else ""
        say(f"  {item.name + default:<26} {_get_first_line(item.cls)}  [{item.provider}]")
        if with_options:
            _print_options(item)


def _print_implementation(item: Implementation) -> None:
    say(f"{item.contract.stage}: {item.name}   by {item.provider}, {item.provider.licence}\n")
    say(inspect.getdoc(item.cls) or "")
    say("\noptions:" if len(item.cls.model_fields) > 1 else "\nno options")
    _print_options(item)


def _print_options(item: Implementation) -> None:
    for name, field in item.cls.model_fields.items():
        if name == "use":
            continue
        default = (
            "required"
            if field.is_required()
            else f"default {_format_default(field.get_default(call_default_factory=True))}"
        )
        say(f"    {name:<20} {field.description or ''} ({default})")


def _format_default(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _get_first_line(cls: type) -> str:
    return (inspect.getdoc(cls) or "").splitlines()[0] if inspect.getdoc(cls) else ""

"""`damageest plugins`: lists the installed plugins, what they provide, and why a plugin is broken."""

from __future__ import annotations

from typing import Any

from damageest.cli._json import AsJson, say_json
from damageest.cli._streams import keep_for_results, say

MOST_SHOWN = 6
"""Implementations of a plugin that are named; of more, their number is printed."""


def command(as_json: AsJson = False) -> None:
    """List installed plugins, and why broken ones fail. With licence, stages, export formats and commands."""
    with keep_for_results(as_json):
        plugins, conflicts = _collect()
    if as_json:
        say_json({"plugins": plugins, "conflicts": conflicts})
        return
    for one in plugins:
        stages = one["stages"] if len(one["stages"]) <= MOST_SHOWN else [f"{len(one['stages'])} stage implementations"]
        shown = [*stages, *([f"export formats: {', '.join(one['formats'])}"] if one["formats"] else [])]
        shown += [f"commands: {', '.join(one['commands'])}"] if one["commands"] else []
        said = ", ".join(shown) or ("broken" if one["broken"] else "no stages")
        say(f"{one['name']} {one['version']}  {one['licence']}  {said}")
        for item in one["broken"]:
            say(f"  broken: {item['reason']}\n  try: {item['remedy']}")
    for conflict in conflicts:
        names = " and ".join(conflict["providers"])
        say(f"conflict: {conflict['stage']} is provided by {names}\n  try: uninstall all but one")


def _collect() -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The plugins, and the implementations that several of them provide."""
    from damageest.cli._commands import load_commands
    from damageest.registry import Registry

    commands = load_commands()
    registry = Registry.discover()
    plugins = [
        {
            "name": provider.name,
            "version": provider.version,
            "licence": provider.licence,
            "stages": [f"{i.contract.stage}: {i.name}" for i in registry.implementations if i.provider == provider],
            "formats": [name for name, owner in registry.formats.items() if owner == provider],
            "commands": list(commands.get(provider.name, ())),
            "broken": [
                {"reason": one.reason, "remedy": one.remedy} for one in registry.broken if one.provider == provider
            ],
        }
        for provider in registry.providers
    ]
    conflicts = [
        {
            "stage": f"{group[0].contract.stage}: {group[0].name}",
            "providers": [str(item.provider) for item in group],
        }
        for group in registry.clashes
    ]
    return plugins, conflicts

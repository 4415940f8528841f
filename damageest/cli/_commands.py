"""The commands of the command line: the built-in ones, and those of plugins, loaded when they are called."""

from __future__ import annotations

from functools import cache
from typing import Any

import typer
from typer.core import TyperGroup

from damageest.cli._streams import say


class Commands(TyperGroup):
    """The built-in commands, and those of plugins. Plugins are loaded only for a command that is not built in, and for
    the list of all, because loading takes time. A plugin replaces no built-in command."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(dict.fromkeys([*super().list_commands(ctx), *_list_names()]))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command; None where there is none. Raises InputError for one of a package that is not installed."""
        if found := super().get_command(ctx, cmd_name):
            return found
        for commands in load_commands().values():
            if cmd_name in commands:
                return commands[cmd_name]
        _refuse_missing(cmd_name)
        return None


@cache
def load_commands() -> dict[str, dict[str, Any]]:
    """The commands that plugins add, by the plugin's package and by name. Of a plugin that fails it says so."""
    from damageest.registry.loading import describe_broken, load

    made = {}
    for plugin, provider in load()[1]:
        if not hasattr(plugin, "damageest_commands"):
            continue
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.callback()(_do_nothing)  # a group also where there is one command
        try:
            plugin.damageest_commands(app)
            group: Any = typer.main.get_command(app)
        except (Exception, SystemExit) as error:
            broken = describe_broken(error, provider)
            say(f"warning: the commands of {provider} are broken: {broken.reason}; {broken.remedy}", err=True)
        else:
            made[provider.name] = dict(group.commands)
    return made


def _list_names() -> list[str]:
    return [name for commands in load_commands().values() for name in commands]


def _do_nothing() -> None:
    pass


def _refuse_missing(name: str) -> None:
    """Raises InputError for a command that a package of this project has."""
    from damageest.registry.bundled import COMMANDS

    if name in COMMANDS:
        from damageest.errors import InputError
        from damageest.registry import Registry

        raise InputError(
            f"'damageest {name}' needs {Registry.discover().describe_plugin(COMMANDS[name])}", code="missing"
        )

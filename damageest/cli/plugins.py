"""`damageest plugins`: lists the installed plugins, what they provide, and why a plugin is broken."""

from __future__ import annotations

from damageest.cli._streams import say


def command() -> None:
    """List installed plugins with licence, stages, export formats and commands, and broken plugins with the reason."""
    from damageest.cli._commands import load_commands
    from damageest.registry import Registry

    commands = load_commands()
    registry = Registry.discover()
    for provider in registry.providers:
        stages = [f"{i.contract.stage}: {i.name}" for i in registry.implementations if i.provider == provider]
        broken = [b for b in registry.broken if b.provider == provider]
        formats = [name for name, owner in registry.formats.items() if owner == provider]
        shown = stages if len(stages) <= 6 else [f"{len(stages)} stage implementations"]
        shown += [f"export formats: {', '.join(formats)}"] if formats else []
        added = commands.get(provider.name)
        shown += [f"commands: {', '.join(added)}"] if added else []
        say(f"{provider}  {provider.licence}  {', '.join(shown) or ('broken' if broken else 'no stages')}")
        for item in broken:
            say(f"  broken: {item.reason}\n  try: {item.remedy}")
    for group in registry.clashes:
        names = " and ".join(str(item.provider) for item in group)
        say(
            f"conflict: {group[0].contract.stage}: {group[0].name} is provided by {names}\n  try: uninstall all but one"
        )

"""`damageest plugins`: lists the installed plugins, what they provide, and why a plugin is broken."""

from __future__ import annotations

import typer


def command() -> None:
    """List installed plugins with licence and stages, and broken plugins with the reason."""
    from damageest.registry import Registry

    registry = Registry.discover()
    for provider in registry.providers:
        stages = [f"{i.contract.stage}: {i.name}" for i in registry.implementations if i.provider == provider]
        broken = [b for b in registry.broken if b.provider == provider]
        shown = ", ".join(stages) if len(stages) <= 6 else f"{len(stages)} stage implementations"
        typer.echo(f"{provider}  {provider.licence}  {shown or ('broken' if broken else 'no stages')}")
        for item in broken:
            typer.echo(f"  broken: {item.reason}\n  try: {item.remedy}")
    for group in registry.clashes:
        names = " and ".join(str(item.provider) for item in group)
        typer.echo(
            f"conflict: {group[0].contract.stage}: {group[0].name} is provided by {names}\n  try: uninstall all but one"
        )

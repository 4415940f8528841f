"""`damageest plugins`: what is installed, what it provides, and what is broken and why."""

from __future__ import annotations

import typer


def command() -> None:
    """List installed plugins, with broken ones and the reason."""
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
        who = " and ".join(str(item.provider) for item in group)
        typer.echo(f"clash: {group[0].contract.stage}: {group[0].name} is provided by {who}; uninstall all but one")

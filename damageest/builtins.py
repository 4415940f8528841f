"""The built-in stages, which come in through the same hook as a third party's."""

from __future__ import annotations

from damageest.hookspecs import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """Every built-in implementation."""
    import importlib
    import pathlib

    from damageest.contracts import contract_of

    out = []
    root = pathlib.Path(__file__).parent / "stages"
    for p in sorted(root.glob("*/*.py")):
        if p.name.startswith("_"):
            continue
        m = importlib.import_module(f"damageest.stages.{p.parent.name}.{p.stem}")
        for v in vars(m).values():
            if (
                isinstance(v, type)
                and v.__module__ == m.__name__
                and issubclass(v, Stage)
                and contract_of(v) not in (None, v)
            ):
                out.append(v)
    return out

"""Which stage implementations there are here, who provides them, and which plugins are broken.

Discovery gives a value: `Registry.discover()` may be called any number of times and changes nothing outside itself.
"""

from __future__ import annotations

import difflib
import hashlib
import importlib.util
import typing
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import Distribution, EntryPoint, entry_points
from pathlib import Path
from typing import Any

import pluggy

import damageest
from damageest import hookspecs
from damageest.contracts import DEFAULTS, STAGES, Contract, contract_of
from damageest.errors import PluginError
from damageest.stages import Stage

GROUP = "damageest"


@dataclass(frozen=True)
class Provider:
    """A distribution that provides stages: its ``name``, ``version``, ``licence`` and the ``module`` of its hooks."""

    name: str
    version: str
    licence: str
    module: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}"

    @cached_property
    def fingerprint(self) -> str:
        """Digest over version and source, so that what a changed implementation gave before is not taken for its own."""
        digest = hashlib.sha256(str(self).encode())
        spec = importlib.util.find_spec(self.module.split(".")[0])
        for place in (spec.submodule_search_locations or [spec.origin]) if spec else []:
            root = Path(str(place))
            for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
                digest.update(path.name.encode() + path.read_bytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class Broken:
    """A plugin, or one implementation of it, that cannot be used: why, and what to do."""

    provider: Provider
    reason: str
    remedy: str


@dataclass(frozen=True)
class Implementation:
    """A stage implementation: the class, the name a job calls it by, the contract it keeps, and who provides it."""

    name: str
    cls: type[Stage]
    contract: Contract
    provider: Provider


@dataclass(frozen=True)
class Registry:
    """All that was found. ``clashes`` are names that two distributions provide: no job can use them until one is gone."""

    implementations: tuple[Implementation, ...]
    providers: tuple[Provider, ...]
    broken: tuple[Broken, ...]
    clashes: tuple[tuple[Implementation, ...], ...]
    hooks: pluggy.PluginManager = field(repr=False)

    @classmethod
    def discover(cls, observers: Iterable[object] = ()) -> Registry:
        """Finds the built-ins and every installed plugin; ``observers`` are extra objects with observing hooks."""
        manager = pluggy.PluginManager(GROUP)
        manager.add_hookspecs(hookspecs)
        found: list[Implementation] = []
        broken: list[Broken] = []
        providers: list[Provider] = []
        own = EntryPoint("builtins", "damageest.builtins", GROUP)
        for point, provider in [(own, _own_provider()), *_installed()]:
            providers.append(provider)
            try:
                plugin = point.load()
                manager.register(plugin, f"{provider.name}:{point.name}")
                classes = plugin.damageest_stages() if hasattr(plugin, "damageest_stages") else []
            except (Exception, SystemExit) as error:
                broken.append(Broken(provider, f"{type(error).__name__}: {error}", _remedy(error, provider)))
                continue
            for stage in classes:
                try:
                    found.append(_implementation(stage, provider))
                except PluginError as error:
                    broken.append(Broken(provider, str(error), f"update or uninstall {provider.name}"))
        for observer in observers:
            manager.register(observer)
        names = [(item.contract.stage, item.name) for item in found]
        groups = {key: tuple(i for i, n in zip(found, names, strict=True) if n == key) for key in dict.fromkeys(names)}
        single = tuple(group[0] for group in groups.values() if len(group) == 1)
        clashes = tuple(group for group in groups.values() if len(group) > 1)
        return cls(single, tuple(providers), tuple(broken), clashes, manager)

    def of(self, stage: str) -> tuple[Implementation, ...]:
        """The implementations of a stage, defaults first, then by name."""
        chosen = [item for item in self.implementations if item.contract.stage == stage]
        return tuple(sorted(chosen, key=lambda item: (DEFAULTS[item.contract] != item.name, item.name)))

    def get(self, stage: str, name: str) -> Implementation:
        """Raises PluginError for a name that clashes, KeyError with a message for one that is not there."""
        for group in self.clashes:
            if (group[0].contract.stage, group[0].name) == (stage, name):
                who = " and ".join(str(item.provider) for item in group)
                raise PluginError(f"'{name}' of stage '{stage}' is provided by {who}; uninstall all but one of them")
        for item in self.of(stage):
            if item.name == name:
                return item
        names = [item.name for item in self.of(stage)]
        raise KeyError(f"stage '{stage}' has no '{name}'{near(name, names)}; there are: {', '.join(names)}{self.missing()}")

    def missing(self) -> str:
        """A clause on plugins that are installed but broken, empty where there are none."""
        parts = [f"{b.provider} is broken ({b.reason.splitlines()[0]}; {b.remedy})" for b in self.broken]
        return f"; {'; '.join(parts)}" if parts else ""


def near(name: str, valid: Sequence[str]) -> str:
    """A near-miss clause: `` (did you mean 'x'?)`` or nothing."""
    close = difflib.get_close_matches(name, valid, n=1, cutoff=0.6)
    return f" (did you mean '{close[0]}'?)" if close else ""


def _own_provider() -> Provider:
    return Provider("damageest", damageest.__version__, "Apache-2.0", "damageest.builtins")


def _installed() -> list[tuple[EntryPoint, Provider]]:
    points = sorted(entry_points(group=GROUP), key=lambda p: (p.dist.name if p.dist else "", p.name))
    return [(point, _provider(point, point.dist)) for point in points]


def _provider(point: EntryPoint, dist: Distribution | None) -> Provider:
    if dist is None:
        return Provider(point.name, "?", "?", point.module)
    meta = dist.metadata
    licence = meta.get("License-Expression") or meta.get("License") or "not stated"
    return Provider(dist.name, dist.version, licence.splitlines()[0], point.module)


def _remedy(error: BaseException, provider: Provider) -> str:
    if isinstance(error, ModuleNotFoundError) and error.name:
        return f"pip install {error.name}, or reinstall {provider.name}"
    return f"update or uninstall {provider.name}"


def _implementation(cls: Any, provider: Provider) -> Implementation:
    """Checks a class against its contract when it is registered, not when it runs."""
    contract = contract_of(cls) if isinstance(cls, type) else None
    if contract is None:
        raise PluginError(f"{cls!r} derives from no contract; the stages are: {', '.join(STAGES)}")
    cls.needs()
    name = _name(cls)
    reserved = [n for n in cls.model_fields if n != "use" and hasattr(Stage, n)]
    if reserved:
        raise PluginError(f"{cls.__qualname__}: option {', '.join(map(repr, reserved))} shadows a reserved name")
    return Implementation(name, cls, contract, provider)


def _name(cls: type[Stage]) -> str:
    choices = typing.get_args(cls.model_fields["use"].annotation)
    if len(choices) != 1 or not isinstance(choices[0], str):
        raise PluginError(f"{cls.__qualname__}: declare its name as  use: Literal['name']")
    return choices[0]

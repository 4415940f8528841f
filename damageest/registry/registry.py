"""Which stage implementations and file formats there are here, who provides them, and which plugins are broken.

Discovery gives a value: `Registry.discover()` may be called any number of times and changes nothing outside itself.
"""

from __future__ import annotations

import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NoReturn, TypeVar

import pluggy
from pydantic import ValidationError

from damageest.artefacts import Floats
from damageest.errors import InputError, PluginError, clean_message, describe_install, suggest
from damageest.registry import bundled
from damageest.registry.contracts import DEFAULTS, STAGES, SURFACE_ONLY, Contract, contract_of
from damageest.registry.guards import compute_joints, guard_conversion, guard_path_writer, guard_writer
from damageest.registry.loading import OWN, Broken, Provider, describe_broken, ignore_shadow_warnings, load
from damageest.result import Conversion
from damageest.rules import RULE_FAILED, Rule, Term
from damageest.rules.notes import RUN_CODES
from damageest.stages import Stage
from damageest.stages.enclose import EncloseAll
from damageest.stages.export import PathWriter, Writer
from damageest.trust.doubts.pose import POSE_CODES

Kind = TypeVar("Kind", Writer, PathWriter)
RESERVED = frozenset((*RUN_CODES, *POSE_CODES, *STAGES, RULE_FAILED))
"""Codes that are those of no rule, and that damageest gives: for notes of a run, doubts of align, and stages' notes."""


@dataclass(frozen=True)
class Implementation:
    """A stage implementation: the class, the name a job calls it by, the contract it keeps, and who provides it."""

    name: str
    cls: type[Stage]
    contract: Contract
    provider: Provider

    @property
    def method(self) -> str:
        """The method that chooses this implementation without naming it: of those that take all sites at once, their
        own; else `surface` for a stage of that route, and empty for one that each method has."""
        if issubclass(self.cls, EncloseAll):
            return self.cls.method
        return "surface" if self.contract in SURFACE_ONLY else ""


@dataclass(frozen=True)
class Registry:
    """All implementations that were found. ``clashes`` are names that two distributions provide: no job can use them.
    ``writers``: the formats that `export` can write, by name; ``formats``: the provider of each. ``path_writers``: the
    formats of paths, by name. ``conversions``: of results, by name. ``rules``: those that give reasons for verdicts.
    ``terms``: of the intervals."""

    implementations: tuple[Implementation, ...]
    providers: tuple[Provider, ...]
    broken: tuple[Broken, ...]
    clashes: tuple[tuple[Implementation, ...], ...]
    hooks: pluggy.PluginManager = field(repr=False)
    writers: Mapping[str, Writer] = field(default_factory=dict, compare=False)
    formats: Mapping[str, Provider] = field(default_factory=dict, compare=False)
    path_writers: Mapping[str, PathWriter] = field(default_factory=dict, compare=False)
    conversions: Mapping[str, Conversion] = field(default_factory=dict, compare=False)
    rules: tuple[Rule, ...] = field(default=(), compare=False)
    terms: tuple[Term, ...] = field(default=(), compare=False)

    @classmethod
    def discover(cls, observers: Iterable[object] = ()) -> Registry:
        """Finds the built-ins and every installed plugin; ``observers`` are extra objects with observing hooks."""
        manager, loaded, broken = load(observers)
        found: list[Implementation] = []
        writers: dict[str, Writer] = {}
        path_writers: dict[str, PathWriter] = {}
        formats: dict[str, Provider] = {}
        conversions: dict[str, Conversion] = {}
        rules: dict[str, Rule] = {}
        terms: dict[str, Term] = {}
        for plugin, provider in loaded:
            try:
                with ignore_shadow_warnings():
                    classes = _read_offered(plugin)
                    added = _read_writers(plugin, "damageest_writers", Writer, writers)
                    added_paths = _read_writers(plugin, "damageest_path_writers", PathWriter, path_writers)
                    converts = _read_conversions(plugin, conversions)
                    added_rules = _read_told(plugin, Rule, rules, provider)  # type: ignore[type-abstract]
                    added_terms = _read_told(plugin, Term, terms, provider)  # type: ignore[type-abstract]
                    if provider.name != OWN:
                        added = {name: guard_writer(name, one, f"{provider}") for name, one in added.items()}
                        added_paths = {
                            name: guard_path_writer(name, one, f"{provider}") for name, one in added_paths.items()
                        }
                        converts = {name: guard_conversion(name, one, f"{provider}") for name, one in converts.items()}
            except BaseException as error:
                broken.append(describe_broken(error, provider))
                continue
            writers |= added
            path_writers |= added_paths
            rules |= added_rules
            terms |= added_terms
            formats |= dict.fromkeys(added, provider)
            conversions |= converts
            for stage in classes:
                try:
                    found.append(_check_implementation(stage, provider))
                except PluginError as error:
                    broken.append(Broken(provider, clean_message(error), f"update or uninstall {provider.name}"))
                except BaseException as error:
                    broken.append(describe_broken(error, provider))
        names = [(item.contract.stage, item.name) for item in found]
        groups = {key: tuple(i for i, n in zip(found, names, strict=True) if n == key) for key in dict.fromkeys(names)}
        single = tuple(group[0] for group in groups.values() if len(group) == 1)
        clashes = tuple(group for group in groups.values() if len(group) > 1)
        providers = tuple(dict.fromkeys([p for _, p in loaded] + [b.provider for b in broken]))
        made = cls(
            single, providers, tuple(broken), clashes, manager, writers, formats, path_writers, conversions,
            tuple(rules.values()), tuple(terms.values()),
        )  # fmt: skip
        for kind, package in bundled.CONVERSIONS.items():
            if kind not in conversions:
                conversions[kind] = partial(_refuse, f"'{kind}' needs {made.describe_plugin(package)}")
        return made

    def of(self, stage: str) -> tuple[Implementation, ...]:
        """The implementations of a stage, defaults first, then by name."""
        chosen = [item for item in self.implementations if item.contract.stage == stage]
        return tuple(sorted(chosen, key=lambda item: (DEFAULTS[item.contract] != item.name, item.name)))

    def methods(self, contract: Contract | None = None) -> tuple[str, ...]:
        """The values of a job's `method`; with a ``contract``, those that its implementations name."""
        if contract is None:
            return ("auto", "both", "surface", *self.methods(EncloseAll))
        return tuple(dict.fromkeys(item.method for item in self.of(contract.stage) if item.contract is contract))

    def usual(self, contract: Contract, method: str) -> str:
        """The name of the implementation of a contract that a ``method`` takes where the job names none."""
        serving = [item.name for item in self.of(contract.stage) if (item.contract, item.method) == (contract, method)]
        return DEFAULTS[contract] if DEFAULTS[contract] in serving or not serving else serving[0]

    def get(self, stage: str, name: str) -> Implementation:
        """Raises PluginError for a name that clashes, KeyError with a message for one that is not there."""
        for group in self.clashes:
            if (group[0].contract.stage, group[0].name) == (stage, name):
                if len({item.provider for item in group}) == 1:
                    who = str(group[0].provider)
                    raise PluginError(
                        f"{who} provides '{name}' of stage '{stage}' more than once; update or uninstall it"
                    )
                who = " and ".join(str(item.provider) for item in group)
                raise PluginError(f"'{name}' of stage '{stage}' is provided by {who}; uninstall all but one of them")
        for item in self.of(stage):
            if item.name == name:
                return item
        if package := bundled.IMPLEMENTATIONS.get((stage, name)):
            raise KeyError(f"'{name}' of stage '{stage}' needs {self.describe_plugin(package)}")
        names = [item.name for item in self.of(stage)]
        raise KeyError(
            f"stage '{stage}' has no '{name}'{suggest(name, names)}; there are: {', '.join(names)}{self.missing()}"
        )

    def describe_plugin(self, name: str) -> str:
        """A clause for what needs a plugin that cannot be used here: the plugin, the reason, and what to do."""
        for broken in self.broken:
            if broken.provider.name == name:
                reason = broken.reason.splitlines()[0]
                return f"the plugin {name}, which cannot be used here ({reason}); try: {broken.remedy}"
        return f"the plugin {name}, which is not installed; try: {describe_install(name)}"

    def describe_writer(self, name: str) -> str:
        """A clause for what needs a format that no package here writes: the plugin, the reason, and what to do. Empty
        where no plugin of this project writes it."""
        return self.describe_plugin(bundled.FORMATS[name]) if name in bundled.FORMATS else ""

    def describe_path_writer(self, name: str) -> str:
        """The same for a format of paths."""
        return self.describe_plugin(bundled.PATH_FORMATS[name]) if name in bundled.PATH_FORMATS else ""

    def find_joints(self, machine: str, poses: Floats, turns: Floats) -> Floats | None:
        """The joints (N,J) of a robot at the poses (N,4,4), from the plugin that knows it; None where none does. Raises
        StageError where the plugin is at fault."""
        return compute_joints(self.hooks.hook.damageest_kinematics, machine, poses, turns)

    def missing(self) -> str:
        """A clause on plugins that are installed but broken, empty where there are none."""
        parts = [f"{b.provider} is broken ({b.reason.splitlines()[0]}; {b.remedy})" for b in self.broken]
        return f"; {'; '.join(parts)}" if parts else ""


def _check_implementation(cls: Any, provider: Provider) -> Implementation:
    """Checks a class against its contract when it is registered, not when it runs."""
    contract = contract_of(cls) if isinstance(cls, type) else None
    if contract is None:
        raise PluginError(f"{cls!r} derives from no contract; the stages are: {', '.join(STAGES)}")
    reserved = [n for n in cls.model_fields if n != "use" and hasattr(contract, n)]
    if reserved:
        raise PluginError(f"{cls.__qualname__}: option {', '.join(map(repr, reserved))} shadows a reserved name")
    changed = [n for n in ("stage", "gives", "per_site") if getattr(cls, n) != getattr(contract, n)]
    if changed:
        raise PluginError(f"{cls.__qualname__} changes {', '.join(map(repr, changed))}, which its contract fixes")
    cls.needs()
    name = _read_name(cls)
    if provider.name != OWN:  # those of the built-ins are tested, and cost each command 0.05 s
        check_defaults(cls)
    return Implementation(name, cls, contract, provider)


def _read_offered(plugin: Any) -> list[Any]:
    """What a plugin's hook gives. A module without that hook may have others, and then gives no stages."""
    classes = plugin.damageest_stages() if hasattr(plugin, "damageest_stages") else []
    if not isinstance(classes, list | tuple):
        raise PluginError(f"its hook damageest_stages gave a {type(classes).__name__} instead of a list of classes")
    return list(classes)


def _read_writers(plugin: Any, hook: str, kind: type[Kind], known: Mapping[str, Kind]) -> dict[str, Kind]:
    """The formats that a plugin can write. Raises PluginError for what is no writer, or of a format known already."""
    found = getattr(plugin, hook)() if hasattr(plugin, hook) else {}
    if not isinstance(found, Mapping) or not all(isinstance(writer, kind) for writer in found.values()):
        raise PluginError(f"its hook {hook} did not give a mapping of format names to {kind.__name__}s")
    if twice := sorted(found.keys() & known.keys()):
        raise PluginError(f"writes {', '.join(twice)}, which another package writes already; uninstall one of them")
    return dict(found)


def _read_conversions(plugin: Any, known: Mapping[str, Conversion]) -> dict[str, Conversion]:
    """What a plugin can convert a result to. Raises PluginError for what is no function, or of a kind known already."""
    found = plugin.damageest_conversions() if hasattr(plugin, "damageest_conversions") else {}
    if not isinstance(found, Mapping) or not all(callable(convert) for convert in found.values()):
        raise PluginError("its hook damageest_conversions did not give a mapping of names to functions")
    if twice := sorted(found.keys() & known.keys()):
        raise PluginError(f"converts to {', '.join(twice)}, as another package does already; uninstall one of them")
    return dict(found)


def _refuse(why: str, *values: object) -> NoReturn:
    raise InputError(why)


T = TypeVar("T", bound=Rule | Term)
HAS = {Rule: ("code", "meaning", "threshold"), Term: ("name", "text", "type")}
"""What a rule and a term have to have; the first is what they are known by."""


def _read_told(plugin: Any, base: type[T], known: Mapping[str, T], provider: Provider) -> dict[str, T]:
    """The rules or the terms that a plugin adds, by code or name. Raises PluginError for what is none, or has the name
    of another, or one that damageest gives itself."""
    what = "rule" if issubclass(base, Rule) else "term"
    hook, names = f"damageest_{what}s", HAS[base]
    told: dict[str, T] = {}
    for cls in getattr(plugin, hook)() if hasattr(plugin, hook) else ():
        if not (isinstance(cls, type) and issubclass(cls, base)):
            raise PluginError(f"its hook {hook} gave {cls!r}, which is not a class derived from {base.__name__}")
        if missing := [name for name in names if not isinstance(getattr(cls, name, None), str)]:
            raise PluginError(f"its {what} {cls.__qualname__} has no {', no '.join(missing)}")
        key = getattr(cls, names[0])
        if key in known or key in told:
            raise PluginError(f"its {what} {cls.__qualname__} has the {names[0]} '{key}', which another {what} has")
        if provider.name != OWN and key in RESERVED:
            raise PluginError(
                f"its {what} {cls.__qualname__} has the {names[0]} '{key}', which damageest gives itself; choose "
                f"another, for example {provider.name.removeprefix('damageest-').replace('-', '_')}_{key}"
            )
        told[key] = cls()
        told[key].owner = "" if provider.name == OWN else f"{provider}"
    return told


def check_defaults(cls: type[Stage]) -> None:
    """Refuses a default that its own option would refuse; options without a default are the job's to give."""
    fields = {name: field for name, field in cls.model_fields.items() if not field.is_required()}
    try:
        cls.model_validate({name: field.get_default(call_default_factory=True) for name, field in fields.items()})
    except ValidationError as error:
        # No place: the options contradict each other as a whole, which a job may mend by setting some.
        wrong = [e for e in error.errors() if e["loc"] and e["loc"][0] in fields]
        if wrong:
            text = "; ".join(f"{e['loc'][0]}: {e['msg']}" for e in wrong)
            raise PluginError(f"{cls.__qualname__}: the default of an option is not valid: {text}") from error


def _read_name(cls: type[Stage]) -> str:
    choices = typing.get_args(cls.model_fields["use"].annotation)
    if len(choices) != 1 or not isinstance(choices[0], str):
        raise PluginError(f"{cls.__qualname__}: declare its name as  use: Literal['name']")
    return choices[0]

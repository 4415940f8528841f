"""Checks a job file completely before anything is read or computed, and collects all its faults."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from damageest.errors import Fault, JobError, PluginError, clean_message, suggest
from damageest.io.files import describe_no_file, resolve_path, working_folder
from damageest.job import yamlfile
from damageest.job.beforehand import find_late_faults
from damageest.job.folders import describe_no_patches, may_be_patches
from damageest.job.model import GROUPS, Header, Job, find_paths
from damageest.job.wording import describe_fault
from damageest.registry import bundled
from damageest.registry.contracts import DEFAULTS, STAGES, SURFACE_ONLY, Contract
from damageest.registry.registry import Implementation, Registry
from damageest.stages import Stage
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan


def load(
    source: str | Path | Mapping[str, Any],
    registry: Registry,
    settings: Sequence[str] = (),
    given: Mapping[Contract, Any] | None = None,
    without: Sequence[str] = (),
    folder: Path | None = None,
) -> Job:
    """Reads and checks a job: a YAML file, or a mapping of the same shape (its paths relative to ``folder``, by
    default the working folder).

    ``settings`` are overrides ``stage.option=value`` or ``field=value``. ``without``: keys of the file that are not
    of the job. Raises JobError naming every fault.
    """
    if isinstance(source, Mapping):
        return _Check(dict(source), {}, "job", folder or working_folder(), registry, given or {}).job(settings, "job")
    path = Path(source)
    if not path.is_absolute():
        working_folder()
    tree, positions = yamlfile.read(path)
    if not isinstance(tree, Mapping):
        raise JobError([Fault("a job is a mapping with at least version, part and scan")], str(path))
    tree = {key: value for key, value in tree.items() if key not in without}
    folder = Path(os.path.realpath(path)).parent
    return _Check(tree, positions, str(path), folder, registry, given or {}).job(settings, path.stem)


Chosen = tuple[Implementation, dict[str, Any]]
"""An implementation and its options, still unchecked."""


@dataclass
class _Check:
    """One pass over a job's tree that collects faults instead of stopping at the first."""

    tree: dict[str, Any]
    positions: yamlfile.Positions
    source: str
    folder: Path
    registry: Registry
    given: Mapping[Contract, Any]
    faults: list[Fault] = field(default_factory=list)
    overridden: dict[tuple[str | int, ...], str] = field(default_factory=dict)
    """By their place, the settings that replaced a value of the job."""
    notes: list[str] = field(default_factory=list)

    def add_fault(self, message: str, *path: str | int) -> None:
        self.faults.append(self.make_fault(message, *path))

    def make_fault(self, message: str, *path: str | int) -> Fault:
        """The fault of a value of the job, with its line and column, or the setting that it is from."""
        place: tuple[str | int, ...] = path
        settings = [text for where, text in self.overridden.items() if path[: len(where)] == where]
        if settings:
            return Fault(message, ".".join(map(str, path)), source=f"--set {settings[-1]}")
        while place and place not in self.positions:
            place = place[:-1]
        line, column = self.positions.get(place, (1, 1) if self.positions else (0, 0))
        return Fault(message, ".".join(map(str, path)), line, column)

    def add_faults(self, told: list[tuple[tuple[str | int, ...], str]]) -> None:
        """Notes faults found by pydantic; what an option with several valid kinds says of each is one fault."""
        for place in dict.fromkeys(place for place, _ in told):
            self.add_fault("; or ".join(dict.fromkeys(text for where, text in told if where == place)), *place)

    def job(self, settings: Sequence[str], stem: str) -> Job:
        for setting in settings:
            self.override(setting)
        known = [*Header.model_fields, *STAGES]
        for key in self.tree:
            if key not in known:
                self.add_fault(f"unknown stage or field{suggest(key, known)}; valid are: {', '.join(known)}", key)
        header = self.check_header()
        named = {key: self.find_named(key) for key in STAGES if key in self.tree}
        for contract in (ReadPart, ReadScan):
            if contract.stage not in named and contract not in self.given:
                self.add_fault(f"missing: give  {contract.stage}: path/to/file", contract.stage)
        chosen = {item.contract: (item, options) for item, options in filter(None, named.values())}
        method: str = header.method if header else "auto"
        contracts, method = self.find_route(method, chosen)
        pairs = {c: chosen.get(c) or self.find_default(c, method) for c in contracts if c not in self.given}
        stages = {c: self.check_stage(pair[0], pair[1]) for c, pair in pairs.items() if pair}
        self.add_faults(find_late_faults(stages, method, self.registry))
        if header and not header.output and (header.name or stem) in (".", ".."):
            self.add_fault("'.' and '..' do not name a folder for the output; give another name, or  output", "name")
        if self.faults or header is None:
            raise JobError(sorted(self.faults, key=lambda f: (f.line, f.column)), self.source)
        name = header.name or stem
        return Job(
            name=name,
            units=header.units,
            tolerance=None if header.tolerance == "auto" else header.tolerance,
            method=method,
            stages={c: s for c, s in stages.items() if s is not None},
            implementations={c: pair[0] for c, pair in pairs.items() if pair},
            output=resolve_path(header.output or Path("out") / name, self.folder),
            source=self.source,
            sites=header.sites,
            accept=header.accept,
            scanner=header.scanner,
            temperature=header.temperature,
            inspect=header.inspect,
            sections=header.sections,
            given=self.given,
            notes=tuple(self.notes),
            make_fault=self.make_fault,
        )

    def override(self, setting: str) -> None:
        """Applies ``stage.option=value``; the value is read as YAML."""
        name, equals, text = setting.partition("=")
        keys = name.strip().split(".")
        if not equals or not all(keys) or len(keys) > 2:
            self.add_fault(f"--set takes stage.option=value or field=value, not '{setting}'")
            return
        value, _ = yamlfile.parse(text, f"--set {setting}")
        known = (*STAGES, *GROUPS)
        if len(keys) == 1 or keys[0] in known:
            self.overridden[tuple(keys)] = setting
        if len(keys) == 1:
            self.tree[keys[0]] = value
        elif keys[0] not in known:
            self.add_fault(f"--set {setting}: unknown stage{suggest(keys[0], known)}; there are: {', '.join(known)}")
        else:
            old = self.tree.get(keys[0]) or {}
            old = old if isinstance(old, dict) else _spell_out(keys[0], old, self.registry)
            self.tree[keys[0]] = {**old, keys[1]: value}

    def check_header(self) -> Header | None:
        values = {key: value for key, value in self.tree.items() if key in Header.model_fields}
        if "version" not in values:
            self.add_fault("missing: give  version: 1", "version")
            values["version"] = 1
        try:
            return Header.model_validate(values)
        except ValidationError as error:
            self.add_faults([(self.find_place(item["loc"]), describe_fault(item, values)) for item in error.errors()])
            return None

    def find_place(self, location: Sequence[str | int]) -> tuple[str | int, ...]:
        """Where a fault of a field is, as far as the job file has it; of a value with several kinds, the kind's name is
        no place."""
        place: tuple[str | int, ...] = tuple(location[:1])
        for step in location[1:]:
            if (*place, step) in self.positions:
                place = (*place, step)
        return place

    def find_named(self, key: str) -> Chosen | None:
        """The implementation a stage's value names, and its options still unchecked; None where that is at fault."""
        value = self.tree[key]
        if value is None or not isinstance(value, (str, list, dict)) or (isinstance(value, list) and key != "scan"):
            self.add_fault(f"give a name, or a mapping with  use: <name>  and options; not {value!r}", key)
            return None
        if isinstance(value, list):  # a list is short for the option `path`: its faults are where its items are
            spelled = {(key, "path", *place[1:]): at for place, at in self.positions.items() if place[:1] == (key,)}
            self.positions = self.positions | spelled
        value = dict(value) if isinstance(value, dict) else _spell_out(key, value, self.registry)
        name = value.pop("use", self.usual_name(key))
        if name == "file" and "path" in value:
            name = self.find_reader(key, value["path"]) or name
        try:
            return self.registry.get(key, str(name)), value
        except (KeyError, PluginError) as error:
            self.add_fault(str(error.args[0]), key, "use")
            return None

    def usual_name(self, key: str) -> str:
        """The implementation meant where a stage is given options and no name."""
        method = self.tree.get("method")
        if key == EncloseAll.stage and method in self.registry.methods(EncloseAll):
            return self.registry.usual(EncloseAll, method)
        by_site = method == "surface" or any(c.stage in self.tree for c in SURFACE_ONLY if c is not Enclose)
        contracts = [c for c in DEFAULTS if c.stage == key and not (by_site and c is EncloseAll)]
        return DEFAULTS[contracts[0] if by_site else contracts[-1]]

    def find_reader(self, key: str, paths: Any) -> str | None:
        """The implementation that reads such a file; None leaves it to `file`, which lists its formats."""
        if paths == []:
            self.add_fault("the list of files is empty", key, "path")
            return None
        first = paths[0] if isinstance(paths, list) else paths
        if isinstance(first, dict):
            first = first.get("path", "")
            if not isinstance(first, str) or not first:
                return None  # its own check says what is missing
        if key == ReadScan.stage and may_be_patches(str(first), self.folder):
            return None
        suffix = Path(str(first)).suffix.lower()
        readers = [item for item in self.registry.of(key) if suffix in item.cls.reads]
        package = bundled.SUFFIXES.get(suffix) if key == ReadPart.stage else None
        if not readers and package:
            self.add_fault(f"'{suffix}' needs {self.registry.describe_plugin(package)}", key, "path")
        elif not readers:
            valid = sorted({s for item in self.registry.of(key) for s in item.cls.reads})
            self.add_fault(f"no reader for '{suffix}' files; valid are: {', '.join(valid)}", key, "path")
        return readers[0].name if readers else None

    def find_route(self, method: str, chosen: Mapping[Contract, Chosen]) -> tuple[list[Contract], str]:
        """The contracts that the job's route needs, and the method in full: `auto` is `surface` where the job names one
        of its stages, and the method of the implementation of `enclose` where the job names one that has its own."""
        if method not in self.registry.methods() and method in bundled.METHODS:
            self.add_fault(f"'{method}' needs {self.registry.describe_plugin(bundled.METHODS[method])}", "method")
            return [], method
        if method not in self.registry.methods():
            valid = self.registry.methods()
            text = (
                f"no method '{method}'{suggest(method, valid)}; there are: {', '.join(valid)}{self.registry.missing()}"
            )
            self.add_fault(text, "method")
            return [], method
        surface = [contract for contract in SURFACE_ONLY if contract in chosen]
        whole_job = chosen.get(EncloseAll)
        own = whole_job[0].method if whole_job else ""
        if method == "auto" and surface and not whole_job:
            method = "surface"
        if method == "auto" and whole_job and whole_job[0].name != DEFAULTS[EncloseAll]:
            method = own
        if whole_job and method not in ("auto", "both", own):
            self.add_fault(
                f"this implementation takes all sites at once; it belongs to  method: {own}", EncloseAll.stage, "use"
            )
        if method in self.registry.methods(EncloseAll):
            for contract in surface:
                self.add_fault(f"not a stage of  method: {method}; remove it, or use  method: surface", contract.stage)
        unused: dict[str, tuple[Contract, ...]] = {"surface": (EncloseAll,), "auto": (), "both": ()}
        return [contract for contract in DEFAULTS if contract not in unused.get(method, SURFACE_ONLY)], method

    def find_default(self, contract: Contract, method: str) -> Chosen | None:
        if contract.stage in ("part", "scan"):
            return None
        try:
            return self.registry.get(contract.stage, self.registry.usual(contract, method)), {}
        except (KeyError, PluginError) as error:
            self.add_fault(str(error.args[0]), contract.stage)
            return None

    def rename_options(self, item: Implementation, options: dict[str, Any]) -> dict[str, Any]:
        """The options by the names that they have now; a note names those that the job has by a former one."""
        key, found = item.contract.stage, dict(options)
        for old, new in item.cls.renamed.items():
            if old not in found:
                continue
            if new in found:
                self.add_fault(f"'{old}' is the former name of '{new}': give one of them", key, old)
            found[new] = found.pop(old)
            self.positions = self.positions | {
                (key, new, *place[2:]): at for place, at in self.positions.items() if place[:2] == (key, old)
            }
            if (key, old) in self.overridden:
                self.overridden[key, new] = self.overridden[key, old]
            self.notes.append(f"{key}: the option {old} is called {new} now; rename it in the job")
        return found

    def check_stage(self, item: Implementation, options: dict[str, Any]) -> Stage | None:
        """The implementation with its options checked, files that it names included."""
        key = item.contract.stage
        options = self.rename_options(item, options)
        try:
            context = {"folder": self.folder, "registry": self.registry}
            stage = item.cls.model_validate({"use": item.name, **options}, context=context)
        except ValidationError as error:
            valid = [name for name in item.cls.model_fields if name != "use"]
            told = []
            for fault in error.errors():
                place: tuple[str | int, ...] = ()
                for step in fault["loc"]:  # of a value with several kinds, the kind's name is no place
                    if (key, *place, step) in self.positions or not isinstance(step, str) or step in valid:
                        place = (*place, step)
                told.append(((key, *(place or fault["loc"])), describe_fault(fault, options, valid, item.name)))
            self.add_faults(told)
            return None
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # of a plugin's own check of its options
            text = f"{type(error).__name__}: {clean_message(error, 400)}"
            self.add_fault(f"{item.provider} failed when it checked the options of '{item.name}': {text}", key)
            return None
        for place, path in find_paths(stage.model_dump()):
            wrong = describe_no_file(path)
            if key == ReadScan.stage and path.is_dir():
                wrong = describe_no_patches(path)
            if wrong:
                self.add_fault(f"{str(path)[-250:]}: {wrong}", key, *place)
        return stage


def _spell_out(key: str, value: str | list[Any], registry: Registry) -> dict[str, Any]:
    """The mapping that a bare value is short for: a name, or for part and scan a path (or paths)."""
    is_file = key in ("part", "scan") and value not in [item.name for item in registry.of(key)]
    return {"use": "file", "path": value} if is_file else {"use": value}

"""What a click writes into a job: each function changes the tree of a job file, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Selector = Mapping[str, Any] | int
"""Skin of the part: the number of a CAD face, or a selector as in the job reference."""

DIGITS = 6
"""Significant digits of lengths that come from a click."""


def to_round(value: Any) -> Any:
    """Numbers with as many digits as a click deserves, as plain values of Python, lists of numbers on one line."""
    if isinstance(value, Mapping):
        return _flow({key: to_round(item) for key, item in value.items()})
    if isinstance(value, (list, tuple)) or getattr(value, "ndim", False):
        return _flow([to_round(item) for item in value])
    if isinstance(value, float) or (hasattr(value, "dtype") and value.dtype.kind == "f"):
        rounded = float(f"{float(value):.{DIGITS}g}")
        return rounded + 0.0  # no negative zero
    return value.item() if hasattr(value, "dtype") else value


def _flow(value: Any) -> Any:
    """A list or mapping that is written on one line."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    made: Any = CommentedMap(value) if isinstance(value, Mapping) else CommentedSeq(value)
    made.fa.set_flow_style()
    return made


def set_field(tree: Any, key: str, value: Any) -> None:
    """A field of the job; None removes it, so that its default holds."""
    if value is None:
        tree.pop(key, None)
    else:
        tree[key] = to_round(value)


def open_stage(tree: Any, stage: str, use: str) -> Any:
    """The mapping of a stage, made from its short form where the job has that. Another implementation than ``use`` is
    replaced by it, and loses its options."""
    from ruamel.yaml.comments import CommentedMap

    value: Any = tree.get(stage)
    if isinstance(value, dict):
        if value.get("use", use) != use:
            value.clear()
        if use and value.get("use") != use and stage not in ("part", "scan"):
            value.insert(0, "use", use)  # type: ignore[attr-defined]
        return value
    made = CommentedMap()
    if getattr(tree, "ca", None) is not None and stage in tree.ca.items:
        made.fa.set_flow_style()  # the comment stands at the end of its line, and what follows it stays below
    if stage in ("part", "scan"):
        if value is not None:
            made["path"] = value
    else:
        made["use"] = use
    tree[stage] = made
    return made


def set_option(tree: Any, stage: str, use: str, option: str, value: Any) -> None:
    """An option of a stage; None removes it."""
    if value is None and not isinstance(tree.get(stage), Mapping):
        return
    mapping = open_stage(tree, stage, use)
    if value is None:
        mapping.pop(option, None)
    else:
        mapping[option] = to_round(value)


def set_unit(tree: Any, of: str, unit: str) -> None:
    """The unit of the file of ``part`` or ``scan``. A tolerance in figures becomes `auto`: it was measured with the
    other unit."""
    stage = open_stage(tree, of, "file")
    stage["unit"] = unit
    if isinstance(tree.get("tolerance"), (int, float)):
        tree["tolerance"] = "auto"


def add_crop(tree: Any, crop: Mapping[str, Any]) -> None:
    """Another crop of the scan, after those that there are."""
    stage = open_stage(tree, "scan", "file")
    _append(stage, "crop", to_round(crop))


def drop_last(tree: Any, stage: str, option: str) -> None:
    """Removes the last entry of a list of a stage, and the list with its last entry."""
    mapping: Any = tree.get(stage)
    if isinstance(mapping, dict) and mapping.get(option):
        mapping[option].pop()
        if not mapping[option]:
            del mapping[option]


def _append(mapping: Any, option: str, value: Any) -> None:
    """Adds to a list that stands one entry on a line."""
    from ruamel.yaml.comments import CommentedSeq

    if not isinstance(mapping.get(option), list):
        mapping[option] = CommentedSeq()
    mapping[option].append(value)


def set_pairs(tree: Any, pairs: Sequence[tuple[Any, Any]]) -> None:
    """Aligns by picked pairs of points: in the frame of the scan, and on the part."""
    stage = open_stage(tree, "align", "points")
    stage.pop("pairs", None)
    for pair in pairs:
        _append(stage, "pairs", to_round(pair))


def set_pose(tree: Any, transform: Any) -> None:
    """Takes this pose (4,4) of the scan, and fits nothing. All its digits are kept."""
    stage = open_stage(tree, "align", "none")
    stage["T_part_scan"] = _flow([_flow([float(value) for value in row]) for row in transform])


def set_register(tree: Any) -> None:
    """Finds the pose anew, without pairs and without a given pose."""
    old = tree.get("align")
    datum = old.get("datum") if isinstance(old, Mapping) else None
    tree["align"] = "register"
    if datum:
        open_stage(tree, "align", "register")["datum"] = datum


def list_datums(datum: Any) -> dict[str, list[Any]]:
    """The faces of each datum by its letter, in the order of precedence; faces without letters under ``""``."""
    if isinstance(datum, Mapping):
        return {
            str(letter): list(one.get("skin", []) if isinstance(one, Mapping) else one) for letter, one in datum.items()
        }
    return {"": list(datum)} if datum else {}


def toggle_datum(tree: Any, face: Selector, letter: str = "") -> None:
    """Adds a face to the datum, or takes it away where it is in it.

    With a ``letter``, to that datum of a system, after those that there are; a face belongs to one of them. Faces that
    had no letters become the first datum, A; without a letter, those of a system are fitted together.
    """
    from ruamel.yaml.comments import CommentedMap

    value = tree.get("align")
    use = value.get("use", "register") if isinstance(value, Mapping) else str(value or "register")
    stage = open_stage(tree, "align", "register" if use == "none" else use)
    datums = list_datums(stage.get("datum"))
    if not letter:
        if isinstance(stage.get("datum"), Mapping):
            stage["datum"] = to_round([one for faces in datums.values() for one in faces])
        toggle(stage, "datum", face)
        return
    if "" in datums:
        stage["datum"] = CommentedMap({"A": stage["datum"]})
    system = stage.setdefault("datum", CommentedMap())
    for other in list(system):
        if other != letter and _has(list_datums(system)[other], face):
            _toggle_in(system, other, face)
    _toggle_in(system, letter, face)
    if not system:
        del stage["datum"]


def _toggle_in(system: Any, letter: str, face: Selector) -> None:
    """Adds a face to a datum of a system or removes it; a datum without faces goes."""
    if isinstance(system.get(letter), Mapping):
        toggle(system[letter], "skin", face)
        if "skin" not in system[letter]:
            del system[letter]
    else:
        toggle(system, letter, face)


def _has(faces: Sequence[Any], face: Selector) -> bool:
    return any(plain(one) in (plain(face), plain(to_round(face))) for one in faces)


def toggle(mapping: Any, option: str, value: Any) -> None:
    """Adds an entry to a list, or removes it where it is there; the last one takes the list with it."""
    there = list(mapping.get(option) or [])
    wanted = to_round(value)
    if _has(there, value):
        del mapping[option][next(k for k, one in enumerate(there) if _has([one], value))]
        if not mapping[option]:
            del mapping[option]
    else:
        _append(mapping, option, wanted)
        if isinstance(wanted, int):
            mapping[option].fa.set_flow_style()


def plain(value: Any) -> Any:
    """A value without what ruamel.yaml and numpy add, to be compared."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, bool):
        return value
    if isinstance(value, (int, float)):
        return float(value) if isinstance(value, float) else int(value)
    return value


def choose_site(tree: Any, number: int, choice: str, is_doubtful: bool) -> None:
    """What a person decides about a site: ``accept``, ``drop``, or ``""`` for the criterion's own verdict."""
    accepted = [one for one in tree.get("accept", []) if one != number] if _is_list(tree.get("accept")) else []
    sites = tree.get("sites") if isinstance(tree.get("sites"), Mapping) else None
    dropped = [one for one in (sites or {}).get("drop", []) if one != number]
    if choice == "accept" and is_doubtful:
        accepted.append(number)
    if choice == "drop":
        dropped.append(number)
    if accepted:
        tree["accept"] = to_round(sorted(accepted))
    elif _is_list(tree.get("accept")):
        del tree["accept"]
    _set_sites(tree, "drop", sorted(dropped))


def merge_sites(tree: Any, numbers: Sequence[int]) -> None:
    """Makes one site of several."""
    sites = tree.get("sites") if isinstance(tree.get("sites"), Mapping) else {}
    joined = set(numbers)
    groups = []
    for group in sites.get("merge", []):
        if joined & set(group):
            joined |= set(group)
        else:
            groups.append(list(group))
    _set_sites(tree, "merge", [*groups, sorted(joined)])


def _set_sites(tree: Any, option: str, value: list[Any]) -> None:
    from ruamel.yaml.comments import CommentedMap

    if value:
        if not isinstance(tree.get("sites"), Mapping):
            tree["sites"] = CommentedMap()
        tree["sites"][option] = to_round(value)
    elif isinstance(tree.get("sites"), Mapping):
        tree["sites"].pop(option, None)
        if not tree["sites"]:
            del tree["sites"]


def _is_list(value: Any) -> bool:
    return isinstance(value, list)


def set_stock(tree: Any, outer: float) -> None:
    """The height of the stock where no face has its own."""
    set_option(tree, "allowance", "milling", "outer", float(outer))


def set_face_stock(tree: Any, face: Selector, outer: float) -> None:
    """The height of the stock on one face; it replaces the one that the face had."""
    stage = open_stage(tree, "allowance", "milling")
    selector = {"faces": [face]} if isinstance(face, int) else dict(face)
    wanted = plain(to_round(selector))
    for target in stage.get("targets") or []:
        if {key: value for key, value in plain(target).items() if key != "outer"} == wanted:
            target["outer"] = to_round(float(outer))
            return
    _append(stage, "targets", to_round({"outer": float(outer), **selector}))


def toggle_keep_out(tree: Any, face: Selector) -> None:
    """Keeps a face free of stock, or no longer."""
    stage = open_stage(tree, "allowance", "milling")
    toggle(stage, "keep_out", {"faces": [face]} if isinstance(face, int) else dict(face))

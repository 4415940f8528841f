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
    if isinstance(value, (list, tuple)) or hasattr(value, "tolist"):
        return _flow([to_round(item) for item in value])
    if isinstance(value, float) or hasattr(value, "dtype"):
        rounded = float(f"{float(value):.{DIGITS}g}")
        return rounded + 0.0  # no negative zero
    return value


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
    """The unit of the file of ``part`` or ``scan``."""
    stage = open_stage(tree, of, "file")
    stage["unit"] = unit


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


def toggle_datum(tree: Any, face: Selector) -> None:
    """Adds a face to the datum, or takes it away where it is in it."""
    value = tree.get("align")
    use = value.get("use", "register") if isinstance(value, Mapping) else str(value or "register")
    stage = open_stage(tree, "align", "register" if use == "none" else use)
    toggle(stage, "datum", face)


def toggle(mapping: Any, option: str, value: Any) -> None:
    """Adds an entry to a list, or removes it where it is there; the last one takes the list with it."""
    there = [plain(item) for item in mapping.get(option) or []]
    wanted = to_round(value)
    if plain(wanted) in there:
        del mapping[option][there.index(plain(wanted))]
        if not mapping[option]:
            del mapping[option]
    else:
        _append(mapping, option, wanted)
        if isinstance(wanted, int):
            mapping[option].fa.set_flow_style()


def plain(value: Any) -> Any:
    """A value without what ruamel.yaml adds, to be compared."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return (
        float(value)
        if isinstance(value, float)
        else int(value)
        if type(value) is not bool and isinstance(value, int)
        else value
    )


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

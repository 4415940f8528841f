"""The cache gives back what was put in, never anything else, and keys tell apart what differs."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from damageest import artefacts
from damageest.artefacts import (
    AdaptedPart,
    BeadFill,
    DatumFit,
    Deposit,
    DepositPath,
    Deviation,
    DisplacementField,
    Enclosure,
    Enclosures,
    Evidence,
    FreeMotion,
    Mesh,
    Part,
    Pose,
    PriorUse,
    Reason,
    Rims,
    Samples,
    Scan,
    Section,
    SectionContour,
    SectionValue,
    Sites,
    Solid,
    Surface,
    Truth,
    Unreached,
)
from damageest.pipeline.cache import Cache, digest

BOX = trimesh.creation.box((3, 2, 1))
FIELD = DisplacementField(np.zeros(3), np.ones(3), np.arange(4 * 5 * 6 * 3).reshape(4, 5, 6, 3) / 7)
SOLID = Solid(BOX.vertices + 1 / 3, BOX.faces)
POINTS = np.random.default_rng(0).normal(size=(7, 3))
TURN = np.array([[0.0, -1, 0, 1 / 3], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
REASON = Reason("other_poses", "two fit", "contradicts", 0.2, "mm", (1.0, 2.0, 3.0), "give it")
FREE = FreeMotion((0.0, 0.6, 0.8), -0.1, 1 / 3, (1.0, 2.0, 3.0), 0.02, "a turn")
DATUM = DatumFit(
    "B", "2 cylinders", (3, 4), ("a turn",), 400, 0.9, 0.1, 1 / 3, (5.0, 5.0), (5.1, 4.9), ("cylinder", "cylinder"),
    ((0.0, 1 / 3, 2.0), (1.0, 2.0, 3.0)), ((0.0, 0.6, 0.8), (0.0, 0.6, 0.8)), (True, False),
)  # fmt: skip
UP = np.tile([0.0, 0.6, 0.8], (7, 1))
UNREACHED = Unreached(1 / 3, "unsupported")
FILL = BeadFill(0.1, 0.99, 1 / 3, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
PATH = DepositPath(
    POINTS, UP, -UP, np.arange(7) + 1 / 3, np.arange(7) > 2, np.arange(1, 8), np.arange(1, 8), np.ones(7, np.int64),
    UP[:1], POINTS[0, :1], 2.0, POINTS[1, :1], 1 / 3, 10.0, SOLID, 0.1, np.inf,
)  # fmt: skip
VALUE = SectionValue("chord", 40.0, None, 0.01, "length", "an edge is not seen")
CONTOUR = SectionContour(POINTS[:, :2], UP[:, 1:], np.r_[np.nan, POINTS[1:, 0]], np.ones(7) / 3, np.arange(7.0))
ARTEFACTS: list[Any] = [
    VALUE,
    CONTOUR,
    Section(
        1,
        "root",
        "blade",
        (1.0, 2.0, 1 / 3),
        (1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0),
        (CONTOUR, CONTOUR),
        (VALUE,),
        2,
        0.9,
        0.1,
        700,
        (("leading edge", 1 / 3, 2.0),),
        ("short",),
    ),
    UNREACHED,
    FILL,
    PATH,
    dataclasses.replace(
        PATH,
        tightest=POINTS[:2],
        unreached=(UNREACHED, UNREACHED),
        missing=SOLID,
        fill=FILL,
        notes=("much travel",),
        kinds=("row",) * 7,
        setup=TURN,
        layer_form="conformal",
        around=np.array([1 / 3, 0.0, 1.0, 40.0]),
        free_ends=np.arange(7) > 3,
    ),
    FREE,
    Mesh(BOX.vertices, BOX.faces),
    SOLID,
    Surface(BOX.vertices, BOX.faces[:5]),
    Deposit(SOLID.vertices, SOLID.faces, SOLID, 0.5, 1 / 3, (0.1, 0.2, 0.3), (4, 7), ((4, 1 / 3),), 0.1, ("clipped",)),
    Deposit(SOLID.vertices, SOLID.faces, milled=SOLID),
    Deposit(SOLID.vertices, SOLID.faces),
    Part(
        BOX.vertices,
        BOX.faces,
        "in",
        "a/b.stl",
        "0f",
        np.arange(12) % 2,
        ("top", "é"),
        ("plane", "cone"),
        0.1,
        ("mended",),
    ),
    Part(BOX.vertices, BOX.faces),
    Truth(None, TURN),
    Truth(SOLID, TURN),
    Truth(None, TURN, SOLID),
    Scan(POINTS, -POINTS, "um", ("x.ply", "y.ply"), 0.1, 0.2, Truth(SOLID, TURN), ("thinned",)),
    Scan(POINTS),
    Scan(POINTS, viewpoints=POINTS[:2], view=np.arange(7) % 3 - 1, total=10**9),
    Samples(POINTS, POINTS, np.arange(7), np.zeros(7, np.uint8), 0.3),
    Pose(TURN, 0.01, 0.9, np.stack([TURN, np.eye(4)]), ("two ways",)),
    FREE,
    Pose(TURN, free=(FREE, FREE), is_held=True),
    DATUM,
    Pose(TURN, datums=(DATUM, DATUM), left=(FREE,), spread=np.arange(12.0).reshape(6, 2) / 7),
    REASON,
    Pose(TURN, doubts=(REASON, Reason("pose_free", "free"))),
    Deviation(POINTS[:, 0], np.arange(7), np.array([0, 1, 2, 3, 0, 1, 2], np.uint8)),
    Sites(np.array([0, 1, 2], np.int32), 2, ("a note",)),
    Rims((np.arange(5), np.arange(3))),
    Rims(()),
    Enclosure(SOLID, (1, 3), ("doubtful",)),
    Enclosures((Enclosure(SOLID, (1,)), Enclosure(SOLID, (2,)))),
    Evidence(0.1, 2, 0.3, 0.4, False, ("why",)),
    AdaptedPart(
        Part(BOX.vertices, BOX.faces),
        BOX.vertices / 3,
        TURN,
        np.ones((2, *BOX.vertices.shape)) / 7,
        0.3,
        0.1,
        0.01,
        0.02,
        (4, 3, 2),
        210,
        0.5,
        ("bent",),
        field=FIELD,
        prior=PriorUse(3, 0.1, 0.3, True),
    ),
    FIELD,
    PriorUse(3, 0.1, 0.3, False),
    (0.25, 1e-300),
    None,
]


def same(first: Any, second: Any) -> bool:
    """Equal in type, in every field, and in every array's kind, shape and bytes."""
    if type(first) is not type(second):
        return False
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()
    if dataclasses.is_dataclass(first):
        return all(same(getattr(first, f.name), getattr(second, f.name)) for f in dataclasses.fields(first))
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(same, first, second))
    return bool(first == second)


def test_every_kind_of_artefact_is_tried() -> None:
    kinds = {value for name in artefacts.__all__ if dataclasses.is_dataclass(value := getattr(artefacts, name))}
    assert kinds
    assert kinds <= {type(value) for value in ARTEFACTS}


@pytest.mark.parametrize("value", ARTEFACTS, ids=lambda value: type(value).__name__)
def test_round_trip(value: Any, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "stages")
    assert cache.get("stage", "k") == (False, None)
    cache.put("stage", "k", value)
    found, again = cache.get("stage", "k")
    assert found
    assert same(value, again)
    arrays = [a for a in vars(again).values() if isinstance(a, np.ndarray)] if dataclasses.is_dataclass(again) else []
    assert not any(array.flags.writeable for array in arrays)
    assert all(path.suffix in (".json", ".npz") for path in (tmp_path / "stages").iterdir())


def test_what_is_no_artefact_is_refused_and_leaves_no_entry(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    with pytest.raises(TypeError, match="not an artefact"):
        cache.put("stage", "k", {1, 2})
    assert cache.get("stage", "k") == (False, None)


@pytest.mark.parametrize("suffix", [".npz", ".json"])
@pytest.mark.parametrize("damage", [b"", b"\x00garbage", b"{}", b"[1", None])
def test_a_damaged_entry_counts_as_not_found(suffix: str, damage: bytes | None, tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.put("stage", "k", SOLID)
    entry = tmp_path / f"stage-k{suffix}"
    if damage is None:
        entry.unlink()
    else:
        entry.write_bytes(damage)
    assert cache.get("stage", "k") == (False, None)


def test_an_entry_cut_short_counts_as_not_found(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.put("stage", "k", SOLID)
    entry = tmp_path / "stage-k.npz"
    whole = entry.read_bytes()
    for length in range(0, len(whole), 97):
        entry.write_bytes(whole[:length])
        assert cache.get("stage", "k") == (False, None)


def test_an_array_changed_on_disk_is_not_given_out(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.put("stage", "k", SOLID)
    entry = tmp_path / "stage-k.npz"
    content = entry.read_bytes()
    place = content.index(SOLID.vertices.tobytes()) + 5
    entry.write_bytes(content[:place] + bytes([content[place] ^ 0x40]) + content[place + 1 :])
    assert cache.get("stage", "k") == (False, None)


def test_a_number_changed_on_disk_is_not_given_out(tmp_path: Path) -> None:
    """One bit in the part that is text: still JSON, still of the right kind, and another value."""
    cache = Cache(tmp_path)
    cache.put("stage", "k", Evidence(0.125, 2))
    entry = tmp_path / "stage-k.json"
    assert cache.get("stage", "k")[0]
    entry.write_text(entry.read_text().replace("0.125", "0.165"))
    assert cache.get("stage", "k") == (False, None)


def test_a_hit_in_an_older_folder_is_carried_over(tmp_path: Path) -> None:
    Cache(tmp_path / "old").put("stage", "k", SOLID)
    cache = Cache(tmp_path / "new", (tmp_path / "missing", tmp_path / "old"))
    assert cache.get("stage", "k")[0]
    assert Cache(tmp_path / "new").get("stage", "k")[0]
    cache.put("stage", "other", SOLID)
    cache.keep_only(["stage-k"])
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"stage-k.npz", "stage-k.json"}
    assert Cache(tmp_path / "old").get("stage", "k")[0]


def test_keys_tell_apart_what_differs(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("x")
    (tmp_path / "b").write_text("x")
    values = [
        0.1, 0.1 + 1e-17 * 10, "0.1", None, (), ("a", "b"), ("ab",), {"a": 1}, {"a": 2}, {"b": 1}, tmp_path / "a",
        POINTS, POINTS.astype(np.float32), POINTS.reshape(3, 7), SOLID, Part(SOLID.vertices, SOLID.faces, unit="in"),
    ]  # fmt: skip
    keys = [digest(value) for value in values]
    assert len(set(keys)) == len(set(map(repr, values)))
    assert digest(tmp_path / "a") == digest(tmp_path / "b"), "files count by their content"
    assert digest(POINTS) == digest(np.asfortranarray(POINTS)), "arrays count by their values"
    before = digest(tmp_path / "a")
    (tmp_path / "a").write_text("y")
    assert digest(tmp_path / "a") != before


def test_an_entry_under_another_name_is_not_found(tmp_path: Path) -> None:
    """Two whole entries that were swapped: each is what it was, but not what its name says."""
    cache = Cache(tmp_path)
    cache.put("align", "a", Pose(TURN))
    cache.put("align", "b", Pose(np.eye(4)))
    for suffix in (".npz", ".json"):
        one, other = tmp_path / f"align-a{suffix}", tmp_path / f"align-b{suffix}"
        one.rename(tmp_path / "held")
        other.rename(one)
        (tmp_path / "held").rename(other)
    assert cache.get("align", "a") == cache.get("align", "b") == (False, None)


@pytest.mark.parametrize(
    "text", ["[" * 100_000 + "]" * 100_000, '{"a":' * 50_000, "\xff", "", "[]", "3", '{"sha256": 1}']
)
def test_a_json_file_that_is_not_ours_is_no_entry(text: str, tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    cache.put("align", "a", Pose(TURN))
    (tmp_path / "align-a.json").write_bytes(text.encode("latin-1"))
    assert cache.get("align", "a") == (False, None)

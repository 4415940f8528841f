"""Checks a 3MF file before it is unpacked: sizes, what its XML declares, and how many bodies it stands for."""

from __future__ import annotations

import zipfile
from collections import Counter
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from damageest.errors import InputError

MOST_RATIO = 100
"""Largest ratio of the unpacked size to the file's. XML of meshes has 5 to 20."""
ALWAYS_ALLOWED = 16 * 2**20
"""Bytes that a file may have unpacked whatever the ratio."""
MOST_DEPTH = 100
"""Largest number of objects inside each other. Assemblies have some ten; the reader's time grows with its cube."""
MOST_BODIES = 1000
"""Largest number of bodies, with each object counted as often as it is placed."""


def check_archive(path: Path) -> None:
    """Raises InputError for a file whose content is far larger than the file, that declares XML entities, or whose
    objects are placed too often. Files that are no 3MF in another way are left to the reader."""
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
            if size > max(ALWAYS_ALLOWED, MOST_RATIO * path.stat().st_size):
                raise InputError(
                    f"{path}: {size / 1e6:.0f} MB are packed into a file of {path.stat().st_size / 1e6:.2g} MB, far "
                    "more than meshes can be packed; export the part again"
                )
            placed: Counter[str] = Counter()
            parts: dict[str, Counter[str]] = {}
            for item in archive.infolist():
                if item.filename.lower().endswith(".model"):
                    _count_bodies(path, archive, item, placed, parts)
    except InputError:
        raise
    except Exception:  # of zipfile, its decompressors and lxml
        return  # the reader says what is wrong
    if _count_placed(path, placed, parts) > MOST_BODIES:
        raise InputError(
            f"{path}: its objects stand for more than {MOST_BODIES} bodies; export the part alone, as one solid"
        )


def _count_bodies(
    path: Path, archive: zipfile.ZipFile, item: zipfile.ZipInfo, placed: Counter[str], parts: dict[str, Counter[str]]
) -> None:
    """Adds what a model of the archive places, and what its objects are made of. Raises InputError for entities."""
    from lxml import etree

    with archive.open(item) as stream:
        events: Any = etree.iterparse(
            stream, events=("start", "end"), resolve_entities=False, no_network=True, load_dtd=False, recover=True
        )
        own, is_first = "", True
        for event, element in events:
            if is_first and element.getroottree().docinfo.internalDTD is not None:
                raise InputError(f"{path}: its XML declares entities, which no 3MF does; export the part again")
            is_first = False
            if event == "start":
                word = etree.QName(element).localname if isinstance(element.tag, str) else ""
                if word == "object":
                    own = element.get("id", "")
                    parts.setdefault(own, Counter())
                elif word == "component":
                    parts.setdefault(own, Counter())[element.get("objectid", "")] += 1
                elif word == "item":
                    placed[element.get("objectid", "")] += 1
            else:
                element.clear()
                while element.getprevious() is not None:
                    del element.getparent()[0]


def _count_placed(path: Path, placed: Counter[str], parts: dict[str, Counter[str]]) -> int:
    """The bodies that the placed objects stand for, `MOST_BODIES` + 1 for more. Raises InputError for an object that
    contains itself, and for too many inside each other: it does not call itself, since there may be any number."""
    used, open_names = set(placed), list(placed)
    while open_names:
        new = set(parts.get(open_names.pop(), ())) - used
        used |= new
        open_names += new
    try:
        order = list(TopologicalSorter({name: parts.get(name, ()) for name in used}).static_order())
    except CycleError:
        raise InputError(f"{path}: one of its objects contains itself; export the part alone, as one solid") from None
    known, depth = dict[str, int](), dict[str, int]()
    for name in order:  # what an object contains comes before it
        inside = parts.get(name, Counter())
        known[name] = min(max(sum(times * known[one] for one, times in inside.items()), 1), MOST_BODIES + 1)
        depth[name] = 1 + max((depth[one] for one in inside), default=0)
    if max(depth.values(), default=0) > MOST_DEPTH:
        raise InputError(
            f"{path}: {max(depth.values())} of its objects are inside each other, more than the {MOST_DEPTH} that are "
            "read; export the part alone, as one solid"
        )
    return min(sum(times * known[name] for name, times in placed.items()), MOST_BODIES + 1)

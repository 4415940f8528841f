"""Names of functions, values and files: the words of the glossary, one a thing."""

from __future__ import annotations

import re
from collections import Counter
from keyword import iskeyword

from tests.sources import ROOT, SOURCES

WORDS = {
    "tolerance": ("lambda", "lamda"),
    "skin": ("nominal_surface", "cad_surface", "hull_surface"),
    "rim": ("brim", "fringe"),
    "damage": ("flaw", "injury"),
    "site": ("damage_spot", "damaged_region"),
    "surplus": ("surfeit", "excess_metal", "overmeasure"),
    "deposit": ("buildup", "build_up"),
    "stock": ("oversize", "machining_allowance"),
    "viewpoint": ("scanner_place", "camera_position"),
    "pose": ("pose_matrix", "placement_matrix"),
}
"""A word of the glossary, and what nothing is called in its place."""
VERBS = ("question", "ask", "say", "tell", "fold", "doubt")
"""No name of a function begins with one: a check finds, measures, describes or notes."""
SAID = {
    "question_size", "say_error", "say_help", "say_json", "say_result", "tell_files", "tell_part",
    "_tell", "_tell_nobody", "_tell_found", "_tell_waits",
}  # fmt: skip
"""Those that speak to a person or a process while it works, and public ones."""
ALIKE = {
    "none.py",  # the implementation that does nothing
    "file.py", "files.py", "meshes.py", "paths.py", "scans.py", "sections.py", "large_scans.py",  # the value, its work
    "coverage.py", "scanner.py", "sensor.py", "surplus.py", "uncertainty.py", "verdicts.py",  # the measure, its step
    "beyond_points.py", "fading.py", "free_pose.py", "inner_surface.py", "other_method.py",
    "two_sheets.py",  # the measure of a doubt, its rule
    "adapt.py", "beside.py", "form.py", "noise.py", "pose.py", "views.py",  # a cause, its term of the interval
    "schema.py", "reference.py", "page.py", "run.py", "polygons.py", "pieces.py",
}  # fmt: skip
"""Files of the core that have one name in two rooms, in one sense."""
NAME = re.compile(r"^ *(?:def|class) (\w+)|^ +(\w+): ", re.MULTILINE)


def list_names() -> set[str]:
    found = (match for path in SOURCES for match in NAME.findall(path.read_text(encoding="utf-8")))
    return {name for one, other in found if not iskeyword(name := one or other)}


def test_one_word_a_thing() -> None:
    glossary = (ROOT / "docs" / "glossary.md").read_text()
    assert not [word for word in WORDS if not re.search(rf"^\| [^|]*\b{word}\b", glossary, re.MULTILINE)]
    others = re.compile(rf"(?:^|_)(?:{'|'.join(word for each in WORDS.values() for word in each)})s?(?:_|$)")
    assert not [name for name in list_names() if others.search(name.lower())]


def test_functions_are_called_by_what_they_do() -> None:
    start = re.compile(rf"^ *def (_?(?:{'|'.join(VERBS)})_\w+)\(", re.MULTILINE)
    found = {name for path in SOURCES for name in start.findall(path.read_text(encoding="utf-8"))}
    assert not found - SAID


def test_a_file_name_has_one_sense() -> None:
    core = (path for path in SOURCES if path.is_relative_to(ROOT / "damageest"))
    count = Counter(path.name for path in core if not path.name.startswith("_"))
    twice = {name for name, number in count.items() if number > 1}
    assert not twice - ALIKE

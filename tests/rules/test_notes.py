"""Notes of a run: in order of what they change, many alike as one line."""

from __future__ import annotations

import pytest

from damageest.artefacts import Reason
from damageest.rules.notes import MOST_PRINTED, RUN_CODES, cap_notes, join_reasons, merge_notes, rank_notes


def test_what_changes_a_decision_comes_first_and_nothing_twice() -> None:
    notes = [
        Reason("cluster", "eps"),
        Reason("surroundings", "a table"),
        Reason("align", "free"),
        Reason("align", "free"),
    ]
    assert [note.code for note in rank_notes(notes)] == ["align", "surroundings", "cluster"]
    assert {note.code for note in notes} <= set(RUN_CODES)


def test_many_specks_are_one_line_with_their_number_and_two_stay() -> None:
    specks = [Reason("speck", f"{k} points", amount=0.1) for k in range(12)]
    other = Reason("align", "free")
    folded = merge_notes((other, *specks))
    assert [note.code for note in folded] == ["align", "speck"]
    assert folded[1].amount == 12
    assert merge_notes(specks[:2]) == tuple(specks[:2])


def test_a_reason_of_several_sites_is_told_once() -> None:
    pose, own = Reason("pose", "free"), Reason("few_points", "3 points")
    joined = join_reasons([(1, pose), (2, pose), (2, own), (5, pose)])
    assert [(one.sites, one.reason) for one in joined] == [((1, 2, 5), pose), ((2,), own)]
    assert joined[0].names == "sites 1, 2, 5"
    assert joined[1].names == "site 2"


@pytest.mark.parametrize("count", [0, 1, MOST_PRINTED])
def test_few_notes_are_all_printed(count: int) -> None:
    notes = [f"note {number}" for number in range(count)]
    assert cap_notes(notes) == notes


def test_of_many_the_first_are_printed_and_the_others_counted() -> None:
    notes = [f"note {number}" for number in range(MOST_PRINTED + 5)]
    printed = cap_notes(notes)
    assert len(printed) == MOST_PRINTED
    assert printed[:-1] == notes[: MOST_PRINTED - 1]
    assert printed[-1].startswith("6 more notes")

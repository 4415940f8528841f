"""Work in threads gives what a loop gives, with as many threads as OMP_NUM_THREADS allows."""

from __future__ import annotations

import threading
import time

import pytest

from damageest.geometry.threads import count_threads, cut_evenly, map_in_threads


@pytest.mark.parametrize("threads", ["1", "2", "5"])
def test_values_are_in_the_order_of_the_items(threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", threads)

    def wait(item: int) -> int:
        time.sleep(0.01 * (5 - item))
        return item**2

    assert map_in_threads(wait, range(5)) == [0, 1, 4, 9, 16]
    assert map_in_threads(wait, []) == []


def test_one_thread_is_the_calling_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert count_threads() == 1
    assert set(map_in_threads(lambda _: threading.get_ident(), range(3))) == {threading.get_ident()}


@pytest.mark.parametrize("text", ["", "four", "0", "-3"])
def test_a_number_that_means_nothing_leaves_at_least_one(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", text)
    assert count_threads() >= 1


def test_an_error_reaches_the_caller() -> None:
    def fail(item: int) -> int:
        raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item 0"):
        map_in_threads(fail, range(3))


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9])
def test_slices_are_the_whole(count: int) -> None:
    pieces = [list(range(count))[own] for own in cut_evenly(count, 4)]
    assert [item for piece in pieces for item in piece] == list(range(count))
    assert max(map(len, pieces)) <= 4

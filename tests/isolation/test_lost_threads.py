"""A search for neighbours that lost one of its threads is no result."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from damageest.isolation.lost_threads import raise_lost


def _thread_func(*args: Any) -> None:
    raise RuntimeError("cannot create std::vector larger than max_size()")


def _other() -> None:
    raise ValueError("of the program that calls")


def run_thread(function: Any) -> None:
    thread = threading.Thread(target=function)
    thread.start()
    thread.join()


def test_scipys_search_runs_threads_that_are_recognized(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread of a real search dies, as for want of memory; scipy itself gives an answer all the same."""
    start = threading.Thread.start

    def start_dying(self: Any) -> None:
        self._target = self._target if threads else _thread_func
        threads.append(self)
        start(self)

    threads: list[Any] = []
    monkeypatch.setattr(threading.Thread, "start", start_dying)
    points = np.random.default_rng(0).random((5000, 3))
    with pytest.raises(MemoryError, match="max_size"), raise_lost():
        cKDTree(points).query(points, workers=2)
    assert len(threads) == 2


def test_threads_of_others_are_told_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []
    monkeypatch.setattr(threading, "excepthook", lambda args: told.append(args.exc_type))
    with raise_lost():
        run_thread(_other)
    run_thread(_other)
    assert told == [ValueError, ValueError]

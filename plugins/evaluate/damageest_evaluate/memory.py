"""Peak memory of this process and of its workers, sampled by psutil in a second process.

A thread of this process could not sample: it stops while a C++ library holds the interpreter lock, and that is when the
most memory is in use. The second process is ``python memory.py PID``. For each line that it reads, it prints the peak
in bytes since its last answer. It ends when its input ends.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time

INTERVAL = 0.02
"""Seconds between two samples."""
LISTED = 5
"""Samples between two lists of the processes that count: this one, and those of stages with a process of their own."""


class PeakMemory:
    """Samples the resident memory of this process until the end of the ``with`` block."""

    def __enter__(self) -> PeakMemory:
        self._sampler = subprocess.Popen(
            [sys.executable, "-P", __file__, str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.take_peak()  # returns as soon as the sampler runs
        return self

    def take_peak(self) -> float:
        """The peak in MB since the last call; in the first call, since the start of the block."""
        assert self._sampler.stdin is not None
        assert self._sampler.stdout is not None
        self._sampler.stdin.write("\n")
        self._sampler.stdin.flush()
        return int(self._sampler.stdout.readline()) / 2**20

    def __exit__(self, *error: object) -> None:
        self._sampler.communicate()


def _serve_peaks(process_id: int) -> None:
    """Prints the peak since the last answer, in bytes, for each line of the standard input."""
    import psutil

    process = psutil.Process(process_id)
    lock, peak, count = threading.Lock(), 0, 0
    workers: list[psutil.Process] = []

    def sample() -> int:
        nonlocal peak, count, workers
        with lock:
            if count % LISTED == 0:  # the list of processes takes longer than a sample
                workers = [child for child in process.children() if child.pid != os.getpid()]
            count += 1
            now = process.memory_info().rss
            for child in workers:
                with contextlib.suppress(psutil.NoSuchProcess):
                    now += child.memory_info().rss
            peak = max(peak, now)
        return int(now)

    def sample_always() -> None:
        while True:
            sample()
            time.sleep(INTERVAL)

    threading.Thread(target=sample_always, daemon=True).start()
    for _ in sys.stdin:
        now = sample()
        with lock:
            answer, peak = peak, now
        print(answer, flush=True)


if __name__ == "__main__":
    _serve_peaks(int(sys.argv[1]))

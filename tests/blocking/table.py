"""The table of blocked packages: the test tree without each package that a machine may lack, one at a time.

    uv run python -m tests.blocking.table [--write benchmarks/results/bare-machines.md] [PACKAGE ...]

Of each package: how many tests are collected, and what becomes of the default tests of the files that use it. It takes
an hour; each row is written as soon as it is known.
"""

from __future__ import annotations

import argparse
import re
import time
from pathlib import Path

from tests.test_collection import LIBRARY, NATIVE, OPTIONAL, list_users, run_pytest

HEAD = "| blocked | lacks | collected | files that use it | passed | skipped | s |\n| --- | --- |" + " ---: |" * 5
BEGIN, END = "<!-- blocked: begin -->", "<!-- blocked: end -->"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, help="page in which the table stands between its marks")
    parser.add_argument("packages", nargs="*", help="default: all, those with native libraries also without libGL")
    given = parser.parse_args()
    native = [] if given.packages else [(name, lacks) for name in NATIVE for lacks in ("", LIBRARY)]
    runs = native + [(name, "") for name in given.packages or OPTIONAL if (name, "") not in native]
    rows: list[str] = []
    for package, lacks in runs:
        rows.append(make_row(package, lacks))
        print(rows[-1], flush=True)
        if given.write:
            page = given.write.read_text()
            before, after = page.partition(BEGIN)[0], page.partition(END)[2]
            table = "\n".join([HEAD, *rows])
            given.write.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{after}")


def make_row(package: str, lacks: str) -> str:
    """The row of a package; what pytest says where it ends with an error, in the last column."""
    begin, users = time.monotonic(), list_users(package)
    try:
        collected = run_pytest("--collect-only", "-m", "", blocked=OPTIONAL[package], lacks=lacks)
        said = run_pytest(*users, blocked=OPTIONAL[package], lacks=lacks) if users else ""
    except AssertionError as error:
        fault = " ".join(re.findall(r"(?:FAILED|ERROR) \S+", str(error))[:3]) or "error"
        return f"| {package} | {lacks} | – | {len(users)} | – | – | {fault} |"
    found = [count_words(collected, "collected"), len(users), count_words(said, "passed"), count_words(said, "skipped")]
    return f"| {package} | {lacks} | {' | '.join(map(str, found))} | {time.monotonic() - begin:.0f} |"


def count_words(said: str, word: str) -> int:
    """The number before a word in the last line of pytest."""
    last = said.strip().splitlines()[-1] if said.strip() else ""
    found = re.search(rf"(\d+)(?:/\d+)? (?:tests? )?{word}", last)
    return int(found[1]) if found else 0


if __name__ == "__main__":
    main()

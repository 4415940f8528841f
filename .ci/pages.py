#!/usr/bin/env python3
"""Runs all commands of README.md and of the pages of docs/, in the order of mkdocs.yml, as a reader would.

.ci/pages.py [--user N] [--only PAGE ...] CHECKOUT

works in the folder where it is called: the README's first commands clone CHECKOUT there, and each page begins with
what they left. Of each command it prints exit status, seconds and megabytes received, of each page those on disk, and
it ends with a table of the pages (benchmarks/results/bare-machines.md), and with 1 where a command failed. With
`--user`, called by root, `apt-get` alone is run as root, all else as the user N.

Above a block, a page may say in a comment `<!-- not run: REASON -->`, or `<!-- file: PATH -->` where the reader saves
it. A line that ends with `# exit status 1` is to end so.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

START = "README.md"
BLOCK = re.compile(r"(?:^<!-- (not run|file): (.*?) -->\n+)?^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
SHELLS = ("sh", "")


@dataclass(frozen=True)
class Block:
    """Commands, or the content of a file. ``skipped``: why they are not run; ``file``: where the reader saves it."""

    text: str
    skipped: str = ""
    file: str = ""

    def commands(self) -> list[str]:
        """The commands, one a line; a line that ends with a backslash goes on."""
        lines = self.text.replace("\\\n", "").splitlines()
        return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def list_pages(root: Path) -> list[Path]:
    """README.md, then the pages in the order of the site."""
    named = re.findall(r": (\S+\.md)$", (root / "mkdocs.yml").read_text(), re.MULTILINE)
    return [root / START, *(path for name in named if (path := root / "docs" / name).is_file())]


def read_blocks(page: Path) -> list[Block]:
    """The blocks of commands of a page, and those that are saved as a file, in their order."""
    found = []
    for mark, said, language, text in BLOCK.findall(page.read_text()):
        if language in SHELLS or mark == "file":
            found.append(Block(text, said if mark == "not run" else "", said if mark == "file" else ""))
    return found


def count_received() -> int:
    """Bytes that the network interfaces received, of all programs on this machine."""
    lines = [line.split(":") for line in Path("/proc/net/dev").read_text().splitlines() if ":" in line]
    return sum(int(counts.split()[0]) for name, counts in lines if not name.strip().startswith(("lo", "ifb", "veth")))


@dataclass
class Reader:
    """Who types: working folder and environment last from one command to the next. ``user``: 0 is who runs this."""

    home: Path
    user: int
    failed: int = 0
    seconds: float = 0
    received: float = 0
    typed: int = 0

    def begin(self, folder: Path) -> None:
        self.save(self.home / ".pages-folder", f"{folder}\n")
        self.save(self.home / ".pages-environment", "")

    def save(self, path: Path, text: str) -> None:
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        for place in (path.parent, path):
            os.chown(place, self.user or -1, -1)

    def type_in(self, command: str) -> subprocess.CompletedProcess[str]:
        place, state = self.home / ".pages-folder", self.home / ".pages-environment"
        script = f'cd "$(cat {place})"\n. {state}\n{command}\nstatus=$?\npwd >{place}\nexport -p >{state}\nexit $status'
        own = {"user": self.user, "group": self.user, "extra_groups": []} if self.user else {}
        if self.user and command.startswith("apt-get"):
            script, own = command.replace("install", "install -y", 1), {}
        return subprocess.run(  # type: ignore[call-overload, no-any-return]
            ["/bin/sh", "-c", script], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, **own
        )

    def run(self, command: str) -> None:
        """Runs a command and prints what it took; where it fails, the end of what it said."""
        wanted = int(found[1]) if (found := re.search(r"# exit status (\d+)$", command)) else 0
        begin, before = time.monotonic(), count_received()
        done = self.type_in(command)
        seconds, received = time.monotonic() - begin, (count_received() - before) / 1e6
        self.seconds, self.received, self.typed = self.seconds + seconds, self.received + received, self.typed + 1
        print(f"{done.returncode:6d} {seconds:7.0f} s {received:7.1f} MB  {command}", flush=True)
        if done.returncode != wanted:
            self.failed += 1
            print("\n".join(f"       | {line}" for line in (done.stdout + done.stderr).splitlines()[-30:]), flush=True)

    def count_disk(self) -> int:
        return int(
            subprocess.run(["du", "-sm", str(self.home)], capture_output=True, text=True, check=False).stdout.split()[0]
        )


def first_run(blocks: list[Block]) -> list[Block]:
    """The commands up to the first one of damageest."""
    commands = blocks[0].commands()
    last = next(k for k, command in enumerate(commands) if command.startswith("damageest"))
    return [Block("\n".join(commands[: last + 1]))]


def list_resets(root: Path) -> Iterator[str]:
    """What takes a clone back to what the README's first commands left."""
    yield "git checkout -q . && git clean -fdxq -e /.venv -e /.uv -e /uv.lock -e __pycache__"
    yield next(line for line in read_blocks(root / START)[0].commands() if line.startswith(".uv/bin/uv sync"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--user", type=int, default=0)
    parser.add_argument(
        "--only", nargs="*", default=[], help="names of pages, as cam.md; README.md's first commands are run anyway"
    )
    parser.add_argument("checkout", type=Path)
    given = parser.parse_args()
    reader, root = Reader(Path.cwd(), given.user), given.checkout.resolve()
    clone = reader.home / "damageest"
    rows = ["| page | commands | failed | s | MB received | MB on disk |", "| --- | ---: | ---: | ---: | ---: | ---: |"]
    for page in list_pages(root):
        blocks, is_start = read_blocks(page), page.name == START
        wanted = not given.only or page.name in given.only
        if not (wanted and any(not block.skipped and not block.file for block in blocks)) and not is_start:
            continue
        print(f"\n{page.relative_to(root)}", flush=True)
        before, reader.seconds, reader.received, reader.typed = reader.failed, 0, 0, 0
        reader.begin(reader.home if is_start else clone)
        for line in () if is_start else list_resets(root):
            if (done := reader.type_in(line)).returncode:
                raise SystemExit(f"{line}\n{done.stdout}{done.stderr}")
        for block in blocks if wanted else first_run(blocks):
            if block.file:
                reader.save(clone / block.file, block.text)
            elif block.skipped:
                print(f"     -  not run: {block.skipped}: {block.commands()[0]}", flush=True)
            else:
                for command in block.commands():
                    reader.run(re.sub(r"git clone (?=\S+ damageest)\S+", f"git clone -q {root}", command))
        disk, failed = reader.count_disk(), reader.failed
        print(f"        {disk} MB on disk", flush=True)
        took = f"{reader.seconds:.0f} | {reader.received:.0f} | {disk}"
        rows.append(f"| {page.name} | {reader.typed} | {failed - before} | {took} |")
    print("", *rows, sep="\n")
    print(f"\n{reader.failed} commands failed")
    return 1 if reader.failed else 0


if __name__ == "__main__":
    sys.exit(main())

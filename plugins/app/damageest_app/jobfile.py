"""A job file that is edited: comments stay, each change can be undone, and a file that another program changed is not
overwritten."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from damageest.errors import DamageestError
from damageest.job.yamlfile import parse, read

Edit = Callable[[Any], None]
"""Changes the tree of a job (a mapping of ruamel.yaml, which keeps comments) in place."""
Check = Callable[[Path], object]
"""Raises DamageestError where the job in a file is not valid."""
MOST_KEPT = 200
"""Changes that can be undone."""


class ConflictError(DamageestError):
    """The file is not as this app has left it."""


class JobFile:
    """The job in ``path``. ``text`` is what the app has read or written last; the file is the only state."""

    def __init__(self, path: Path) -> None:
        """Raises JobError for a file that cannot be read as YAML."""
        self.path = path
        self.done: list[str] = []
        self.undone: list[str] = []
        self.reload()

    def reload(self) -> None:
        """Reads the file as it is now; a text of the app that it replaces can be restored by `undo`."""
        read(self.path)  # its limits hold before a parser sees the text
        text = self.path.read_text(encoding="utf-8")
        before = getattr(self, "text", text)
        if text != before:
            self._keep(before)
        self.text = text

    @property
    def values(self) -> dict[str, Any]:
        """The job as plain values."""
        tree = parse(self.text, str(self.path))[0]
        return dict(tree) if isinstance(tree, dict) else {}

    def edit(self, change: Edit, check: Check) -> bool:
        """Applies a change and writes the file; gives whether the text is another one.

        Raises ConflictError where the file was changed by another program, and what ``check`` raises; the file is then
        as before.
        """
        tree = _yaml().load(self.text)
        change(tree)
        stream = io.StringIO()
        _yaml().dump(tree, stream)
        text = stream.getvalue()
        if text == self.text:
            return False
        before = self.text
        self._write(text, check)
        self._keep(before)
        return True

    def undo(self) -> bool:
        """Takes the last change back. Gives whether there was one. Raises ConflictError as `edit`."""
        return self._step(self.done, self.undone)

    def redo(self) -> bool:
        """Makes the change again that was taken back last."""
        return self._step(self.undone, self.done)

    def _step(self, source: list[str], target: list[str]) -> bool:
        if not source:
            return False
        before = self.text
        self._write(source[-1], lambda _: None)
        source.pop()
        target.append(before)
        return True

    def _keep(self, text: str) -> None:
        self.done = [*self.done, text][-MOST_KEPT:]
        self.undone = []

    def _write(self, text: str, check: Check) -> None:
        """Replaces the file in one step, so that it is never half written."""
        self.require_same()
        draft = self.path.with_name(f".{self.path.name}.draft")
        draft.write_text(text, encoding="utf-8")
        try:
            check(draft)
            os.replace(draft, self.path)
        finally:
            draft.unlink(missing_ok=True)
        self.text = text

    def require_same(self) -> None:
        """Raises ConflictError where the file is not as the app has read or written it."""
        try:
            there = self.path.read_text(encoding="utf-8")
        except OSError as error:
            raise ConflictError(f"{self.path.name} cannot be read any more: {error.strerror}") from None
        if there != self.text:
            raise ConflictError(
                f"{self.path.name} was changed by another program or another tab; your last change was not written. "
                "Press Reload, then make it again"
            )


def _yaml() -> Any:
    """A parser and writer that leaves what it does not change as it is, as far as it can."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="rt")
    yaml.width = 4096
    yaml.preserve_quotes = True
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml

"""What is printed after Ctrl-C, and the exit status."""

from __future__ import annotations

text = "interrupted; finished stages are kept, and the same command continues after them"
"""A command that knows more says so here before it ends."""
STATUS = 130
"""The exit status then, as of a shell."""

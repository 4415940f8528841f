"""Texts that are not damageest's own are fit to be shown."""

from __future__ import annotations

import errno
import time
import unicodedata

from damageest.errors import MOST_TEXT, clean_message, describe_missing_library, describe_shortage


def test_what_a_terminal_obeys_is_written_out() -> None:
    for code in (*range(0x20), *range(0x7F, 0xA0), 0x200F, 0x2028, 0x202E, 0x2067, 0xD800, 0xDFFF):
        text = clean_message(f"a{chr(code)}b")
        assert text in ("a b", "a\nb", f"a{ascii(chr(code))[1:-1]}b"), hex(code)
        assert not any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in text.replace("\n", ""))
        text.encode()


def test_what_people_write_stays() -> None:
    text = "Länge 3 µm, 部件 is 5\N{NO-BREAK SPACE}mm too long\n  try: ±2 🔧"
    assert clean_message(text) == text


def test_a_long_text_is_cut_and_says_so() -> None:
    start = time.perf_counter()
    text = clean_message("\x1b" * 50_000_000)
    assert time.perf_counter() - start < 1
    assert len(text) < 5 * MOST_TEXT
    assert text.endswith("(cut: 50,000,000 characters)")


def test_an_error_without_text_is_named() -> None:
    class Mute(Exception):  # noqa: N818
        def __str__(self) -> str:
            raise RuntimeError("no words")

    assert clean_message(Mute()) == "(a Mute without text)"


def test_want_of_memory_is_not_taken_for_a_broken_installation() -> None:
    fault = describe_missing_library(ImportError("libopenblas.so: failed to map segment from shared object"))
    assert str(fault).startswith("ran out of memory, for libopenblas.so")
    for error in (MemoryError(), OSError(errno.ENOMEM, "Cannot allocate memory", "package/checks")):
        assert str(describe_shortage(error)).startswith("ran out of memory")
    assert str(describe_shortage(RuntimeError("can't start new thread"))).startswith("no thread can be started")
    assert str(describe_shortage(SystemError("error return without exception set"))).startswith("a library failed")
    for other in (RuntimeError("other"), SystemError("other")):
        assert describe_shortage(other) is None

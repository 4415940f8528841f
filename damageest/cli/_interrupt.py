"""What is printed after Ctrl-C, and the exit status; an interrupt that Python drops is sent again."""

from __future__ import annotations

import _thread
import signal
import sys
import threading

text = "interrupted; finished stages are kept, and the same command continues after them"
"""A command that knows more says so here before it ends."""
STATUS = 130
"""The exit status then, as of a shell."""
AGAIN_SECONDS = 0.05
"""After this time a dropped interrupt is sent again: long enough for a callback to end."""


def keep_interrupts() -> None:
    """From now on no Ctrl-C is lost in this process.

    Python drops an exception that is raised in a destructor or in the callback of a weak reference, and only prints
    it: a Ctrl-C at that moment would change nothing, and the run would go on.
    """
    before = sys.unraisablehook

    def send_again(dropped: sys.UnraisableHookArgs) -> None:
        if not issubclass(dropped.exc_type, KeyboardInterrupt):
            before(dropped)
            return
        timer = threading.Timer(AGAIN_SECONDS, _send)
        timer.daemon = True
        timer.start()

    sys.unraisablehook = send_again


def _send() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)  # it wakes a thread that waits, too
    else:
        _thread.interrupt_main()

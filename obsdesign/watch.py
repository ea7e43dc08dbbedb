"""A command in a child of its own, which is ended from outside where it does not end by itself.

While compiled code runs, such as a solve or a product of huge rationals, Python hears no signal. So a limit of time and
an interrupt are told to the child, which leaves nothing half-written, and kept here if it does not hear them in time.
"""

import mmap
import os
import signal
import struct
import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from obsdesign.errors import TimeLimitError, listed

LATE = 1.0  # s until which a command ends by itself
ORDERLY = 60.0  # s until which one does that was interrupted and writes what is done; a second interrupt ends it
UNDECIDED, INTERRUPTED, KILLED = 4, 130, 128  # exit codes, the last with the number of a signal
INTERRUPTS = (signal.SIGINT, signal.SIGTERM)  # of a user, and of who cancels a job
DIES_WITH_PARENT = 1  # PR_SET_PDEATHSIG

LIMIT = struct.Struct("dd")  # s that are allowed, and the end of them on the monotonic clock; zero: no limit
GRACE = struct.Struct("d")  # s within which the child ends by itself once it is interrupted
shared = mmap.mmap(-1, LIMIT.size + GRACE.size)  # by parent and child
interrupted: list[int] = []  # signals that the child heard


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Give up after so many seconds; every second again, for an error raised within a destructor is lost.

    Raises `TimeLimitError`: the time is over, whatever this became on its way, such as an ImportError.
    """
    over = False

    def stop(signum: int, frame: FrameType | None) -> None:  # noqa: ARG001
        nonlocal over
        over = True
        raise late(seconds)

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds, LATE)
    LIMIT.pack_into(shared, 0, seconds, time.monotonic() + seconds)
    try:
        yield
    except Exception as raised:
        if over and not hasattr(raised, "exit_code"):  # an answer has one
            raise late(seconds) from None
        raise
    finally:
        LIMIT.pack_into(shared, 0, 0, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def orderly() -> None:
    """Let this command write what is done once it is interrupted, however busy the machine."""
    GRACE.pack_into(shared, LIMIT.size, ORDERLY)


def late(seconds: float) -> TimeLimitError:
    """Error that so many seconds are over."""
    return TimeLimitError(f"not finished after {seconds:g} s; --timeout allows more", id="OBS905")


def watched(command: Callable[[], None]) -> int:
    """Run a command in a child, and return its exit code: 4 if it was late, 130 if it was interrupted."""
    if not hasattr(signal, "sigtimedwait"):  # elsewhere than on Linux
        command()
        return 0
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # or, were it ignored, nobody would know how a child ended
    ignored = (signal.SIG_IGN, None)  # as a shell has it for what runs in the background
    interrupts = [number for number in INTERRUPTS if signal.getsignal(number) not in ignored]
    heard = (signal.SIGCHLD, *interrupts)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, heard)
    if child := os.fork():
        return awaited(child, heard)
    try:
        for number in interrupts:
            signal.signal(number, interrupt)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        sys.unraisablehook = lost
        with_parent()
        command()
    except BaseException:
        if not interrupted:
            raise
        return INTERRUPTED  # whatever the interrupt became on its way, such as an ImportError
    finally:
        deaf()  # all is done
    return 0


def interrupt(signum: int, frame: FrameType | None) -> None:  # noqa: ARG001
    """Raise for the first interrupt; a second one would break what cleans up."""
    deaf()
    interrupted.append(signum)
    raise KeyboardInterrupt


def deaf() -> None:
    """Hear no interrupt from now on."""
    for number in INTERRUPTS:
        signal.signal(number, signal.SIG_IGN)


def lost(raised: Any) -> None:
    """Say nothing of an interrupt or a limit of time that is lost within a destructor: it is kept from outside."""
    if not issubclass(raised.exc_type, KeyboardInterrupt | TimeLimitError):
        sys.__unraisablehook__(raised)


def with_parent() -> None:
    """Let this child end where its parent was killed (Linux only)."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(DIES_WITH_PARENT, signal.SIGKILL)


def awaited(child: int, signals: Collection[signal.Signals]) -> int:
    """Exit code of the child, to which these signals are told."""
    since = again = 0.0
    while True:
        heard = signal.sigtimedwait(signals, LATE / 4)
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            return INTERRUPTED if since else code if code >= 0 else KILLED - code
        if heard and heard.si_signo != signal.SIGCHLD:
            os.kill(child, heard.si_signo)
            again = time.monotonic()
            since = since or again
        seconds, end = LIMIT.unpack_from(shared)
        grace = max(LATE, *GRACE.unpack_from(shared, LIMIT.size))
        if since and (again > since + LATE or time.monotonic() > since + grace):
            return killed(child, "interrupted", INTERRUPTED)
        if end and time.monotonic() > end + LATE:
            if "--json" in sys.argv:
                tell(1, listed(late(seconds).problems))
            return killed(child, str(late(seconds)), UNDECIDED)


def killed(child: int, why: str, code: int) -> int:
    """End a child that does not hear, and say why."""
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    tell(2, why)
    return code


def tell(stream: int, text: str) -> None:
    """Print a line on a stream, if that can be written."""
    with suppress(OSError):
        os.write(stream, f"{text}\n".encode())

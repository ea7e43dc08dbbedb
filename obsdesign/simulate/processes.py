"""Work that is shared out among processes of this machine, which begin as copies of this one (Linux)."""

from collections.abc import Callable, Iterator
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from obsdesign.errors import Problem, UsageError
from obsdesign.watch import deaf, with_parent

DONE, REFUSED = b"d", b"r"  # how an answer begins
ENDS = b"\0"  # between the problems of a refusal, and between their parts


def shared_out(count: int, work: Callable[[int], bytes], jobs: int) -> Iterator[tuple[int, bytes]]:
    """Numbers of parts, from 0, and what comes of each, as they end; what is under way ends with the iterator.

    One process does the first, the next the second, and so on, so that nothing depends on how fast each is. Raises
    `UsageError` where a part does, `RuntimeError` where a process breaks.
    """
    jobs = min(jobs, count)
    if jobs <= 1:
        yield from ((number, work(number)) for number in range(count))
        return
    context, workers = get_context("fork"), dict[Any, Any]()
    try:
        for first in range(jobs):
            mine, theirs = context.Pipe(duplex=False)
            process = context.Process(target=answer, args=(theirs, work, range(first, count, jobs)), daemon=True)
            process.start()
            theirs.close()
            workers[mine] = process
        while workers:
            heard: list[Any] = wait(list(workers))
            for connection in heard:
                try:
                    number = int.from_bytes(connection.recv_bytes(), "big")
                    answered = connection.recv_bytes()
                except EOFError:
                    broken(workers.pop(connection))
                    continue
                if answered[:1] == REFUSED:
                    raise UsageError(*refused(answered[1:]))
                yield number, answered[1:]
    finally:
        for connection, process in workers.items():
            process.kill()
            process.join()
            connection.close()


def answer(connection: Connection, work: Callable[[int], bytes], numbers: range) -> None:
    """Do some parts, in a process of its own."""
    deaf()  # the parent hears it, and keeps the limit of time
    with_parent()
    for number in numbers:
        try:
            answered = DONE + work(number)
        except UsageError as error:
            parts = ((one.message, one.file, one.key, one.id) for one in error.problems)
            answered = REFUSED + ENDS.join(part.encode() for problem in parts for part in problem)
        connection.send_bytes(number.to_bytes(8, "big"))
        connection.send_bytes(answered)


def refused(text: bytes) -> Iterator[Problem]:
    """Problems of a refusal."""
    parts = [part.decode() for part in text.split(ENDS)]
    for message, file, key, id in zip(*(parts[k::4] for k in range(4)), strict=True):
        yield Problem(message, file, key=key, id=id)


def broken(process: Any) -> None:
    """Let go of a process that has ended; raises `RuntimeError` if it did not end by itself."""
    process.join()
    if process.exitcode:
        raise RuntimeError(f"a process of the runs ended with code {process.exitcode}")

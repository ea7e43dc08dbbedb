"""python -m obsdesign, and the command obsdesign."""

import gc
import os
import sys

OBJECTS = 250_000  # new ones, after which garbage is looked for


def main() -> None:
    """Entry point.

    Where standard error is closed, its lines are lost and the exit code is what it would be: that of an error is its
    own, and a success is one. Without standard output there is no success.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    try:
        from obsdesign.watch import watched

        code = watched(command)
    except KeyboardInterrupt:
        code = 130
    sys.exit(code)


def command() -> None:
    """Read and run the command line.

    What is imported lives to the end: Python looks for garbage in it again and again while it grows and once more when
    it ends, finds none, and takes a fifth of the time of a short command. Here it looks after as many new objects as no
    short command makes, some tens of megabytes, and not at the end, where all memory goes anyway.
    """
    gc.set_threshold(OBJECTS, *gc.get_threshold()[1:])
    from obsdesign.cli import main

    try:
        main()
    finally:
        gc.freeze()


if __name__ == "__main__":
    main()

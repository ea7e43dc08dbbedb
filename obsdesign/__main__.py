"""python -m obsdesign, and the command obsdesign."""

import gc
import os
import sys

OBJECTS = 100_000  # new ones, after which garbage is looked for


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

    What is imported lives to the end: Python looks for garbage in it again and again while it grows, finds none, and
    takes a tenth of the time of a short command. Here it looks after as many new objects as no import makes; they hold
    some ten megabytes.
    """
    gc.set_threshold(OBJECTS, *gc.get_threshold()[1:])
    from obsdesign.cli import main

    main()


if __name__ == "__main__":
    main()

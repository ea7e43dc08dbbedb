"""python -m obsdesign, and the command obsdesign."""

import os
import sys


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
    """Read and run the command line."""
    from obsdesign.cli import main

    main()


if __name__ == "__main__":
    main()

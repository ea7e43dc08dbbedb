"""python -m obsdesign, and the command obsdesign."""

import sys


def main() -> None:
    """Entry point."""
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

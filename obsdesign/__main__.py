"""python -m obsdesign."""

from obsdesign.cli import main

main()

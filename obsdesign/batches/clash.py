"""Specs whose results would stand in the place of others, so that none of them can be run; folders without results."""

import os
from collections.abc import Iterable, Iterator
from pathlib import PurePath

from obsdesign.batches.find import SUMMARY, Task
from obsdesign.batches.record import ENDINGS, RECORD
from obsdesign.errors import Problem


def clashes(tasks: Iterable[Task]) -> dict[Task, Problem]:
    """What is wrong with each spec whose results would leave their folder, or stand where those of another do.

    Also with each folder that cannot be read, which stands for the specs in it.
    """
    found, kept = dict[Task, Problem](), list[Task]()
    for task in tasks:
        if os.path.isdir(task.path):
            said = "this folder, or what is in it, cannot be read; let it be read, or leave it out by --exclude"
            found[task] = Problem(said, task.path, id="OBS101")
        elif ".." in (parts := PurePath(task.place).parts) or parts[0] == SUMMARY:
            said = f"a spec cannot have this name: its results would leave their folder, or stand in that of {SUMMARY}"
            found[task] = Problem(said, task.path, id="OBS912")
        else:
            kept.append(task)
    for task, other, where in pairs(kept):
        for one, another in ((task, other), (other, task)):
            said = f"its results would stand in {where}, as those of {another.path}; rename one of them"
            found.setdefault(one, Problem(said, one.path, id="OBS912"))
    return found


def pairs(tasks: Iterable[Task]) -> Iterator[tuple[Task, Task, str]]:
    """Specs of the same folder, and such that the folder of one is a file of the other, with its path."""
    owners, files = dict[str, Task](), dict[str, Task]()
    for task in tasks:
        other = owners.setdefault(task.place, task)
        if other is not task:
            yield task, other, task.place
        files |= {str(PurePath(task.place, f"{task.name}{end}")): task for end in (*ENDINGS.values(), RECORD)}
    for place, task in owners.items():
        for where in (place, *map(str, PurePath(place).parents)):
            if where in files:
                yield task, files[where], where

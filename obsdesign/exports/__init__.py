"""An observer as code that runs without this package.

subject.py    what is exported: an observer in steps, with what is proved of it in words
vectors.py    what a run in the same steps gives it, and what it estimates
code.py       expressions as code; one file for each target beside it
"""

import os
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from obsdesign.disk import write_all
from obsdesign.errors import Problem, UsageError
from obsdesign.records import dataclass

if TYPE_CHECKING:
    from obsdesign.design import Design
    from obsdesign.exports.subject import Subject
    from obsdesign.spec import Spec

Target = Literal["c", "python", "matlab", "fmu"]
TARGETS: tuple[Target, ...] = get_args(Target)


@dataclass(frozen=True, repr=False)
class Exported:
    """Files of an exported observer by their names, and what they are about."""

    subject: "Subject"
    files: dict[str, bytes]
    notes: tuple[str, ...] = ()  # what is to be said of them

    def write(self, folder: str | os.PathLike[str]) -> list[str]:
        """Write the files into a folder, which is made and must be empty, all or none; their paths.

        Raises `UsageError`: the folder is not empty, or cannot be written.
        """
        require_empty(folder)
        path = Path(folder)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(Problem(f"cannot be made: {error.strerror}", str(path), id="OBS902")) from None
        written = {str(path / name): content for name, content in self.files.items()}
        write_all(written)
        return list(written)

    def __repr__(self) -> str:
        return f"<export of {self.subject.name}: {', '.join(self.files)}>"


def require_empty(folder: str | os.PathLike[str]) -> None:
    """Refuse a folder that is not empty, or no folder; raises `UsageError`."""
    path = Path(folder)
    if path.exists() and not path.is_dir():
        raise UsageError(Problem("is a file; name a folder, which is made", str(path), id="OBS904"))
    if path.is_dir() and any(path.iterdir()):
        said = "is not empty; name another folder, or empty this one"
        raise UsageError(Problem(said, str(path), id="OBS914"))


def export(
    source: "Design | Spec | str | os.PathLike[str]",
    to: Target,
    *,
    name: str = "",
    period: str | float | None = None,
    method: str | None = None,
    single: bool = False,
) -> Exported:
    """Observer as code: `export("motor.gains.json", "c").write("motor-c")`.

    `source`: a design, a result file, whose claim is proved anew, or a spec, which is solved first; `to`: c, python,
    matlab or fmu; `name`: an identifier in place of the one made of the spec's name of file; `period` (s) and `method`
    (euler, rk4, exact): steps in place of those of `implementation`; `single`: floats of 32 bits, in C only.

    Raises `UsageError`: there are no gains, or no steps; the period is above the largest step that is stable for every
    member of the class; the target is not known.
    """
    from obsdesign.work import trial

    target = checked_target(to)
    return exported(trial(source), target, name=name, period=period, method=method, single=single)


def exported(
    design: "Design",
    to: Target,
    *,
    name: str = "",
    period: str | float | None = None,
    method: str | None = None,
    single: bool = False,
) -> Exported:
    """Export of a design; see `export`."""
    from obsdesign.exports.subject import subject_of
    from obsdesign.exports.vectors import vectors

    if single and to != "c":
        raise UsageError("--float is for C: the others compute in doubles", id="OBS904")
    with design.spec.placed():
        subject = subject_of(design, name, period, method, single)
        if to == "python" and iskeyword(subject.name):
            said = f"{subject.name} is a word of Python, so no module of this name can be imported"
            raise UsageError(f"--name: {said}; give --name x_{subject.name}", id="OBS904")
        tested = vectors(design, subject)
        made: dict[str, bytes] = import_module(f"obsdesign.exports.{to}").files(subject, tested)
    about = f"the self-test runs on waves in place of u and y: {tested.why}"
    return Exported(subject, made, (about,) if tested.why and to == "c" else ())


def checked_target(to: str) -> Target:
    """Target of an export, if it is one; raises `UsageError`."""
    for target in TARGETS:
        if to == target:
            return target
    raise UsageError(f"--to: {to!r} is no target; allowed: {', '.join(TARGETS)}", id="OBS904")

"""The signals that act in a run, `simulation: {w, v, u}`: expressions, and columns of files."""

from collections.abc import Sequence
from pathlib import PurePosixPath, PureWindowsPath

from obsdesign.expressions import Expression
from obsdesign.model.disturbance import Generator
from obsdesign.reading.generator import Exogenous
from obsdesign.reading.plant import Layout
from obsdesign.reading.trial_schema import FromFile, Signals
from obsdesign.records import dataclass, field
from obsdesign.sections.document import Loc
from obsdesign.sections.scalars import described
from obsdesign.sections.values import RECORDED, Axis, Reader
from obsdesign.sections.words import unknown
from obsdesign.spec import numbered
from obsdesign.trial import Column

ENDINGS = (".csv", ".tsv", ".txt", ".dat")  # of files of columns: no spec makes a run look into any other


@dataclass
class Acting:
    """Reads the signals of a run, and keeps those that are in files."""

    reader: Reader
    layout: Layout
    exogenous: Exogenous
    recorded: dict[str, Column] = field(default_factory=dict)  # by their variables

    def w(self, written: Signals | None) -> tuple[Expression, ...] | None:
        """Disturbances; None where they are not given."""
        if written is None:
            return None
        names, model = self.layout.names.w if self.layout.names else (), self.exogenous.generator
        found = self.read(written, "w", self.layout.w, names, self.layout.known("states"))
        self.require_static(found, names, model)
        return found

    def v(self, written: Signals | None) -> tuple[Expression, ...]:
        """What drives the disturbance model."""
        return self.read(written, "v", self.exogenous.v, numbered("v", self.exogenous.v.size or 0), ("t",))

    def u(self, written: Signals | None) -> tuple[Expression, ...]:
        """Known inputs."""
        axis = Axis(None if self.layout.names is None else len(self.inputs), "input")
        return self.read(written, "u", axis, self.inputs, self.layout.known("states"))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the known inputs."""
        return self.layout.names.inputs if self.layout.names else ()

    def silent(self, written: Signals | None) -> tuple[str, ...]:
        """Known inputs that are not given, neither by name nor all in a list."""
        return tuple(
            name for name in self.inputs if written is None or (isinstance(written, dict) and name not in written)
        )

    def read(
        self,
        written: Signals | None,
        key: str,
        axis: Axis,
        names: Sequence[str],
        known: Sequence[str] | None,
    ) -> tuple[Expression, ...]:
        """Expressions of signals in a list, or by their names; those without one are 0."""
        loc: Loc = ("simulation", key)
        if not isinstance(written, dict):
            for text in [written] if isinstance(written, str) else written or ():
                if RECORDED.fullmatch(text):
                    said = f"a file goes with a signal: write {key}: {{NAME: {{file: {described(text)}, column: ..}}}}"
                    self.reader.wrong(loc, said, id="OBS212")
                    return ()
            return self.reader.expressions(written, loc, axis, known)
        if known is None:
            return ()
        if "file" in written and "file" not in names:
            said = (
                f"a file goes with a signal: write {key}: {{{names[0] if names else 'NAME'}: {{file: .., column: ..}}}}"
            )
            self.reader.wrong(loc, said, id="OBS212")
            return ()
        for name in written:
            if name not in names:
                self.reader.wrong((*loc, name), unknown(axis.each, name, names, {}), at_key=True, id="OBS203")
        return tuple(self.signal(written.get(name, "0"), key, name, known) for name in names)

    def signal(self, written: str | FromFile, key: str, name: str, known: Sequence[str]) -> Expression:
        """Expression of a signal; of one in a file the variable that stands for it."""
        loc: Loc = ("simulation", key, name)
        if isinstance(written, str):
            if RECORDED.fullmatch(written):
                said = f"a file is written {{file: {described(written)}, column: ..}}, with the column of {name}"
                self.reader.wrong(loc, said, id="OBS212")
                return Expression.number(0)
            return self.reader.expression(written, loc, known)
        if said := outside(written.file):
            self.reader.wrong((*loc, "file"), f"{described(written.file)} {said}", id="OBS216")
        time = written.time or "t"
        found = Column(f"simulation.{key}.{name}", name, written.file, written.column or name, time, written.hold)
        self.recorded[found.variable] = found
        return Expression.variable(found.variable)

    def require_static(self, w: Sequence[Expression], names: Sequence[str], model: Generator | None) -> None:
        """Refuse a column of a file for a w that a disturbance model generates, whose v would be its derivative."""
        for name, signal, inverse in zip(names, w, model.inverse if model else (), strict=False):
            if signal.text in self.recorded and inverse != (1,):
                said = f"a disturbance model generates {name}, whose v is no column of a file: give v, or an expression"
                self.reader.wrong(("simulation", "w", name), said, id="OBS206")


def outside(path: str) -> str:
    """Why a path is not that of a file of columns below a folder; empty if it is."""
    parts = PureWindowsPath(path)
    if PurePosixPath(path).is_absolute() or parts.drive or parts.root:
        return "is no relative path; give that of a file below the folder of the spec"
    if ".." in parts.parts:
        return "leads out of the folder of the spec; give the path of a file below it"
    if not path.lower().endswith(ENDINGS):
        return f"is no file of columns; its name must end with {' or '.join(ENDINGS)}"
    return ""

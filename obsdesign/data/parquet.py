"""A Parquet file as a table, read some rows at a time; pyarrow is an extra."""

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.files.table import Block, Header, Table
from obsdesign.records import dataclass

ROWS = 100_000  # at once


@dataclass(frozen=True)
class Parquet(Table):
    """Columns of numbers by their names; a `line` is the number of a row, from 1.

    Raises `UsageError`: pyarrow is not installed, the file is none of Parquet, or a column holds no numbers.
    """

    @cached_property
    def file(self) -> Any:
        """The file, opened."""
        self.opened().close()
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError:
            said = "pyarrow, which reads Parquet, is not installed: pip install obsdesign[parquet]"
            raise UsageError(Problem(said, self.path, id="OBS815")) from None
        try:
            return pq.ParquetFile(self.path)
        except (pa.ArrowException, OSError) as error:
            raise self.wrong(f"is no Parquet file: {str(error).splitlines()[0]}", 0, id="OBS811") from None

    @property
    def share(self) -> float:
        """Share of the rows that are read."""
        return min(1.0, self.progress[0] / max(1, int(self.file.metadata.num_rows)))

    @cached_property
    def columns(self) -> tuple[Header, ...]:
        """Names of the columns."""
        return tuple(map(Header.of, self.file.schema_arrow.names))

    @property
    def heading(self) -> int:
        """Number that stands for the names of the columns in messages."""
        return 1

    def blocks(self, wanted: Sequence[int], times: Collection[int] = ()) -> Iterator[Block]:
        """Rows of some columns, some at a time."""
        names, first = [self.file.schema_arrow.names[i] for i in wanted], 1
        for batch in self.file.iter_batches(ROWS, columns=list(dict.fromkeys(names))):
            timed = [i in times for i in wanted]
            columns = [self.numbers(batch, name, timed=one) for name, one in zip(names, timed, strict=True)]
            rows = np.column_stack(columns)
            self.progress[0] += len(rows)
            yield Block(rows, np.arange(first, first + len(rows)))
            first += len(rows)

    def numbers(self, batch: Any, name: str, *, timed: bool) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Values of a column, of instants the seconds since 1970-01-01; NaN where there is none."""
        import pyarrow as pa

        column = batch.column(batch.schema.names.index(name))
        if timed and pa.types.is_timestamp(column.type):
            column = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64())
            return np.asarray(column.to_numpy(zero_copy_only=False), dtype=float) / 1e9
        try:
            return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=float)
        except pa.ArrowException:
            raise self.wrong(f"{name}: {column.type} is no column of numbers", 0, id="OBS811") from None

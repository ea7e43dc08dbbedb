"""Results and runs as text for a terminal."""

from obsdesign.tables.constants import constants_table
from obsdesign.tables.design import design_table
from obsdesign.tables.run import run_table

__all__ = ["constants_table", "design_table", "run_table"]

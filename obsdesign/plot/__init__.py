"""Figures of runs and of trade-off curves, as PNG."""

from obsdesign.plot.run import run_figure
from obsdesign.plot.tradeoff import tradeoff_figure

__all__ = ["run_figure", "tradeoff_figure"]

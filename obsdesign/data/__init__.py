"""Recorded data: logs in, estimates out.

table.py         a file of columns, read block by block: CSV; parquet.py: Parquet, where pyarrow is installed
log.py           the signals of a spec in such a file: names, units, instants
runner.py        an observer along the rows of a log, as compiled C or as Python
radius.py        what is proved of the error of each estimate
innovations.py   statistics of what is measured against what was expected
estimation.py    all of it, for a file of any length
"""

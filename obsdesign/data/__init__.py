"""Recorded data: logs in, estimates out.

log.py           the signals of a spec in a file of columns (`obsdesign.files.table`): names, units, instants
parquet.py       such a file of Parquet, where pyarrow is installed
runner.py        an observer along the rows of a log, as compiled C or as Python
radius.py        what is proved of the error of each estimate
innovations.py   statistics of what is measured against what was expected
estimation.py    all of it, for a file of any length
"""

"""Result files, read back exactly, and columns of numbers; what reads and writes any file is `obsdesign.disk`."""

from obsdesign.files.result import ResultFile, as_read, checks, csv, digest, release, rows, to_json, witness, written

__all__ = [
    "ResultFile",
    "as_read",
    "checks",
    "csv",
    "digest",
    "release",
    "rows",
    "to_json",
    "witness",
    "written",
]

"""Files in and out: result files, read back exactly, and whatever is written whole or not at all."""

from obsdesign.files.disk import STAGED, content_of, is_regular, newest, require_writable, umask, write_all, write_whole
from obsdesign.files.result import ResultFile, as_read, checks, csv, digest, rows, to_json, witness, written

__all__ = [
    "STAGED",
    "ResultFile",
    "as_read",
    "checks",
    "content_of",
    "csv",
    "digest",
    "is_regular",
    "newest",
    "require_writable",
    "rows",
    "to_json",
    "umask",
    "witness",
    "write_all",
    "write_whole",
    "written",
]

"""Result files: written whole or not at all, and read back exactly.

A number in a result file is a decimal that is read as written, or a text "p/q" of any length.
"""

from obsdesign.artifacts.files import require_writable, write_all, write_whole
from obsdesign.artifacts.result import result
from obsdesign.artifacts.text import checks, csv, digest, to_json

__all__ = ["checks", "csv", "digest", "require_writable", "result", "to_json", "write_all", "write_whole"]

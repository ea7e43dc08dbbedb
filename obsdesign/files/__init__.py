"""Result files: written whole or not at all, and read back exactly.

A number in a result file is a decimal that is read as written, or a text "p/q" of any length.
"""

from obsdesign.files.read import ResultFile
from obsdesign.files.text import checks, csv, digest, to_json
from obsdesign.files.write import require_writable, write_all, write_whole

__all__ = ["ResultFile", "checks", "csv", "digest", "require_writable", "to_json", "write_all", "write_whole"]

"""JSON text of a result: a key of the document a line, and an entry of a list of tables a line.

Python's encoder with `indent` is not its fast one, and puts each number of a matrix on a line.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """Document as UTF-8; NaN and infinity are refused by a ValueError.

    What UTF-8 cannot say, as a byte of a file's name that is none, is an escape of JSON.
    """
    lines = [f" {_text(key)}: {_value(value)}" for key, value in document.items()]
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode("utf-8", "backslashreplace")


def sha256_of_files(files: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of each file, in hex digits, by its name."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}


def _value(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(f"  {_text(item)}" for item in value) + "\n ]"
    return _text(value)


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)

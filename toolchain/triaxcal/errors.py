"""The error a user can cause, told in one line.

A wrong command line is click's own error, exit code 2; everything else that a user can cause is a
`RefusedError`, exit code 1. Every message says where (file, row, key), what was found, what was
expected and what to do.
"""

from __future__ import annotations


class RefusedError(Exception):
    """The data or the result was refused.

    Parameters
    ----------
    where : str
        File, row, key: as near to the cause as is known.
    found : str
        What is there.
    expected : str
        What should be there.
    remedy : str
        What to do about it.
    """

    exit_code = 1

    def __init__(self, where: str, found: str, *, expected: str = "", remedy: str = "") -> None:
        self.where = where
        self.found = found
        self.expected = expected
        self.remedy = remedy
        text = f"{where}: {found}"
        if expected:
            text += f"; expected {expected}"
        if remedy:
            text += f"; {remedy}"
        super().__init__(" ".join(text.split()))

"""The errors a user can cause, each told in one line.

RefusedError            the data or the result was refused: exit code 1
  UsageError            what was asked for does not exist or fit together: exit code 2

Every message says where (file, row, key), what was found, what was expected and what to do.
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


class UsageError(RefusedError):
    """The command line is wrong in a way that click cannot know."""

    exit_code = 2

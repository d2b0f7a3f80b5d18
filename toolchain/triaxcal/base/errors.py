"""The errors that a user can cause, each reported in one line.

RefusedError            the data or the result was refused: exit code 1
  ContradictionError    readings contradict each other: a diagnosis can name the cause
  UsageError            what was asked for does not exist or fit together: exit code 2

Every message has the place (file, row, key), what was found, what was expected, what to do.
"""

from __future__ import annotations

from typing import Any


class RefusedError(Exception):
    """The data or the result was refused.

    Its four parts are attributes, so that a program can show them in its own way; `str` is the line
    that the command line prints.

    Attributes
    ----------
    place : str
        File, row, key: as near to the cause as is known.
    found : str
        What is there.
    expected : str
        What should be there.
    remedy : str
        What to do about it.
    exit_code : int
        Of the command line: 1, or 2 for a `UsageError`.
    """

    exit_code = 1

    def __init__(self, place: str, found: str, *, expected: str = "", remedy: str = "") -> None:
        self.place = place
        self.found = found
        self.expected = expected
        self.remedy = remedy
        text = f"{place}: {found}"
        if expected:
            text += f"; expected {expected}"
        if remedy:
            text += f"; {remedy}"
        super().__init__(" ".join(text.split()))

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process: the parts, which the text alone would lose."""
        return _again, (type(self), self.place, self.found, self.expected, self.remedy)


def refused_by_system(
    place: object, what: str, error: OSError, *, expected: str = "", remedy: str = ""
) -> RefusedError:
    """Error of a file that "cannot be" read or written (`what`), for the system's reason."""
    found = f"cannot be {what}: {reason_of(error)}"
    return RefusedError(str(place), found, expected=expected, remedy=remedy)


def reason_of(error: OSError) -> str:
    """Why the operating system refused."""
    return (error.strerror or str(error)).lower()


class ContradictionError(RefusedError):
    """Readings contradict each other or their description, and the cause has to be found."""


class UsageError(RefusedError):
    """The command line is wrong in a way that click cannot know."""

    exit_code = 2


def _again(kind: type[RefusedError], *parts: str) -> RefusedError:
    place, found, expected, remedy = parts
    return kind(place, found, expected=expected, remedy=remedy)

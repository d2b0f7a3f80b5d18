"""A result with its text and picture. On its own, so that a small study imports no large one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from triaxcal.base.errors import RefusedError

T = TypeVar("T")


@dataclass(frozen=True)
class Study(Generic[T]):
    """A result, with its text and picture.

    Attributes
    ----------
    result : object
        Its class is that of the function's return type.
    summary : str
        The text that the command line prints.
    """

    result: T
    summary: str
    _draw: Callable[[], bytes] | None = None

    def __str__(self) -> str:
        return self.summary

    def __repr__(self) -> str:
        """Short: the result holds whole arrays."""
        return f"<{type(self).__name__} of {type(self.result).__name__}>\n{self.summary}"

    def picture(self) -> bytes:
        """The picture, as SVG.

        Raises
        ------
        RefusedError
            Where the study has none.
        """
        if self._draw is None:
            raise RefusedError("picture", "this study has no picture")
        return self._draw()

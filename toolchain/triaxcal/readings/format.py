r"""Formats of recordings, and the one way in which a file of any of them is read.

To add a format, put one file into readings/formats/ that defines `ENTRY`, a `Format`:

    def _open(path: Path, layout: FileLayout) -> Source:
        import h5py                                   # here, for the package is optional
        file = h5py.File(path)
        return ArraySource(str(path), {name: file[name] for name in file}, layout)

    ENTRY = Format(
        name="hdf5", label="HDF5", doc="Data sets of one length; a column is a data set.",
        extensions=(".h5", ".hdf5"), sniff=starts_with(b"\x89HDF\r\n\x1a\n"), open=_open,
        package="h5py",
    )

`arrays.ArraySource` serves whatever gives arrays, or slices like one, so that a large file is not
loaded whole. A format that reads row after row derives from `Source` and gives `Block`s of at most
`PIECE` rows. A format refuses with `RefusedError` what it understands to be wrong. What its package
raises becomes one line, "damaged, or not HDF5: ...", in `opened.RecordingFile`. That class also
finds a missing package, absent or ambiguous columns, and a file that changes while it is read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from triaxcal.base.registry import Registry
from triaxcal.model.types import FloatArray, IntArray
from triaxcal.unit.recordingfile import FileLayout

PIECE = 1 << 16
"""Rows of a block at most."""


@dataclass(frozen=True)
class Block:
    """Consecutive rows of some columns.

    Attributes
    ----------
    numbers : array, shape (n, columns)
        NaN where a number is missing. A column of whole numbers that a double cannot hold, as
        nanoseconds since 1970, has its first value taken off: only differences of times count.
    texts : tuple of lists of n str
        One list for each column that was asked for as text.
    rows : array, shape (n,)
        Row or line of the file, from 1.
    """

    numbers: FloatArray
    texts: tuple[list[str], ...]
    rows: IntArray


class Source:
    """An opened file: its columns, and its rows in blocks.

    Attributes
    ----------
    names : tuple of str
        Of the columns; "" of a column that has only a number. In a file of several tables (sheets,
        topics, groups) each is "table.column".
    tables : tuple of str
        Table of each column; empty where the file is one table. All columns of a recording must be
        of one.
    clocks : mapping of str to (int, str)
        Column of the times that the format itself gives each table, and their unit.
    numbered : sequence of int
        Indices of the columns that are also counted: number 1 is the first of them.
    row_word : str
        What `Block.rows` counts: "row", or "line" of a text.
    separated : str
        What separates the cells of a text, in words.
    findings : tuple of str
        What was left out, for the report.
    units : mapping of int to str
        Units that the file itself states of columns, as unit.toml names them where it can.
    """

    names: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    clocks: Mapping[str, tuple[int, str]] = MappingProxyType({})
    numbered: Sequence[int] = ()
    row_word: str = "row"
    separated: str = ""
    findings: tuple[str, ...] = ()
    units: Mapping[int, str] = MappingProxyType({})

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Blocks of at most `PIECE` rows, in the order of the file; each call starts anew.

        Parameters
        ----------
        numbers, texts : indices into `names`
            Columns to give as numbers and as text, in this order; one may be in both.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Format:
    """A format of recordings: an entry of `FORMATS`.

    Attributes
    ----------
    name : str
        Value of the key `format`.
    label, doc : str
        Name for readers, and what is a column in it.
    open : callable
        Opens a path with the layout of its table.
    extensions : tuple of str
        Lower case, with the dot: they count where no content is recognised.
    sniff : callable
        Whether the first 4096 bytes of a file are of this format.
    package : str
        Package that reads it; "" for the project's own reader.
    extra : str
        Extra of pyproject.toml that installs it.
    ours : bool
        Whether it is read by code of this project alone: what that raises is a fault, no damage.
    rank : int
        Formats of a lower one are asked first.
    """

    name: str
    label: str
    doc: str
    open: Callable[[Path, FileLayout], Source]
    extensions: tuple[str, ...] = ()
    sniff: Callable[[bytes], bool] = lambda head: False  # noqa: ARG005
    package: str = ""
    extra: str = "recordings"
    ours: bool = False
    rank: int = 100


FORMATS = Registry(
    "format", ("triaxcal.readings.formats", "triaxcal.rig.formats"), Format, ("open",)
)


def starts_with(*magic: bytes) -> Callable[[bytes], bool]:
    """`Format.sniff` for files that start with one of these."""
    return lambda head: head.startswith(magic)

"""A fragment for a Makefile, to include."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "make")


ENTRY = Target("make", "make", "A fragment for a Makefile, to include.", _make, rank=2)

"""An Arduino library."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "arduino", "src", "src")


ENTRY = Target("arduino", "Arduino", "An Arduino library.", _make, rank=5)

"""A Zephyr module."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "zephyr")


ENTRY = Target("zephyr", "Zephyr", "A Zephyr module.", _make, rank=3)

"""A PlatformIO library."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "platformio", "src", "src")


ENTRY = Target("platformio", "PlatformIO", "A PlatformIO library.", _make, rank=4)

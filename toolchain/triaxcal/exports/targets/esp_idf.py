"""An ESP-IDF component."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "esp-idf")


ENTRY = Target("esp-idf", "ESP-IDF", "An ESP-IDF component.", _make, rank=6)

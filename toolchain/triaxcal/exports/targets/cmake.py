"""A CMake package: add_subdirectory, or install and find_package."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "cmake")


ENTRY = Target(
    "cmake",
    "CMake",
    "A CMake package: add_subdirectory, or install and find_package.",
    _make,
    rank=1,
)

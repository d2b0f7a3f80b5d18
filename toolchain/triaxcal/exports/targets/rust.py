"""A crate that compiles the C and makes bindings by bindgen."""

from triaxcal.exports.layout import layout
from triaxcal.exports.target import Exported, Source, Target


def _make(source: Source) -> Exported:
    return layout(source, "rust", "c", "c")


ENTRY = Target(
    "rust", "Rust", "A crate that compiles the C and makes bindings by bindgen.", _make, rank=7
)

"""The thermal functions that there are, and the keys of [thermal] that belong to them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from triaxcal.base.keys import Key
from triaxcal.base.kinds import word
from triaxcal.base.registry import Registry
from triaxcal.model.thermal.shape import ThermalFunction

THERMAL_FUNCTIONS = Registry("thermal function", "triaxcal.model.thermal", ThermalFunction)
AUTO = "auto"
"""In place of a name: every function's candidates are tried on held-out data."""


def owners(key: str) -> tuple[ThermalFunction, ...]:
    """Functions that have a key of this name."""
    return tuple(f for f in THERMAL_FUNCTIONS if key in {k.name for k in f.keys})


def thermal_keys() -> tuple[Key[Any], ...]:
    """Key `model` of [thermal] and those of all functions, each name once."""
    found: dict[str, Key[Any]] = {}
    for key in (k for f in THERMAL_FUNCTIONS for k in f.keys):
        names = " or ".join(f'"{f.name}"' for f in owners(key.name))
        doc = f"{key.doc.removesuffix('.')}; with model = {names} only."
        before = found.setdefault(key.name, replace(key, doc=doc))
        if before.default_words != key.default_words:
            words = f"{before.default_words}; {key.default_words}"
            found[key.name] = replace(before, default_words=words)
    model = Key(
        "model",
        word((AUTO, *THERMAL_FUNCTIONS.names)),
        f"Thermal functions. {AUTO}: the one with the smallest held-out error. "
        + THERMAL_FUNCTIONS.explained,
        AUTO,
    )
    return (model, *found.values())

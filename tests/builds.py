"""Generated C of a plan, as the tests write and compile it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from plans import SENSOR
from triaxcal.codegen.constants import Provenance, render_constants
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.render import render_routine
from triaxcal.codegen.routines import Generated, start_generated
from triaxcal.fixedpoint.plan import Plan

UNITS = Path(__file__).parent.parent / "units"
PROVENANCE = Provenance("GOLDEN-001", "0123456789abcdef" * 4, ("fixed constants of the tests",))


def write_generated(plan: Plan, folder: Path, provenance: Provenance = PROVENANCE) -> None:
    """Write what a delivery writes for the firmware."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = render_routine(plan)
    texts |= render_constants(plan, SENSOR, provenance)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class Built:
    """A plan, the folder with its generated C, and that C as a library."""

    plan: Plan
    folder: Path
    generated: Generated

    @property
    def image(self) -> bytes:
        return image_bytes(self.plan)


class Builds(dict[str, Built]):
    """Plans by name, each compiled when it is first asked for."""

    def __init__(self, plans: Mapping[str, Plan], folder: Path) -> None:
        super().__init__()
        self.plans, self._folder = plans, folder

    def __missing__(self, name: str) -> Built:
        plan, folder = self.plans[name], self._folder / name
        write_generated(plan, folder)
        self[name] = Built(plan, folder, Generated(start_generated(folder, folder).load()))
        return self[name]

"""The delivered files in a folder of their own, and what the checks need to know of the plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from triaxcal.codegen.forms import form_of
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import render_routine, routine_file
from triaxcal.codegen.shim import write_shim
from triaxcal.codegen.templates import environment
from triaxcal.fixedpoint.angles import AnglesPlan
from triaxcal.fixedpoint.plan import Plan
from triaxcal.fixedpoint.proof import Bound
from triaxcal.unit.arithmetic import LIMBS, PORTABLE
from triaxcal.verify.image_reader import image_length

ROUTINE = "triax_comp.c"
CONSTANTS = "triax_calib.c"
SELFTEST = "triax_selftest.c"
ANGLES = "triax_angles.c"
HEADERS = ("triax_comp.h", "triax_calib.h")
IMAGE = "triax_calib.bin"
SHIM = "names"
"""Folder of headers of the default names, where the unit has a prefix."""


def host_forms(plan: Plan) -> dict[str, str]:
    """Forms of the routine that a host can run, each with its C file; assembly needs its core."""
    forms = dict.fromkeys((PORTABLE, form_of(plan.shape, LIMBS)))
    return {form: routine_file(plan, form) for form in forms}


@dataclass(frozen=True)
class Workspace:
    """Delivered files on disk, and the routine in limbs where the shape has that form.

    Attributes
    ----------
    folder : Path
        Holds the delivered files; a check may add its own beside them, under its own names.
    plan, bound : of the delivery
    angles : AnglesPlan or None
        Of the device's angles, where the delivery has them.
    """

    folder: Path
    plan: Plan
    bound: Bound
    angles: AnglesPlan | None = None

    @classmethod
    def create(
        cls,
        folder: Path,
        files: Mapping[str, bytes],
        plan: Plan,
        bound: Bound,
        angles: AnglesPlan | None = None,
    ) -> Workspace:
        """Write the delivered files into `folder`."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        texts = render_routine(replace(plan, arithmetic=LIMBS))
        for name in host_forms(plan).values():
            if name not in files:
                (folder / name).write_text(texts[name], encoding="utf-8")
        write_shim(folder / SHIM, plan.prefix)
        return cls(folder, plan, bound, angles)

    @property
    def image(self) -> bytes:
        """The delivered constants, without the identity behind them."""
        content = (self.folder / self.named(IMAGE)).read_bytes()
        return content[: image_length(content)]

    @property
    def forms(self) -> dict[str, str]:
        """Forms of the routine that a host can run, each with its C file."""
        return host_forms(self.plan)

    def named(self, name: str) -> str:
        """Name of a file of the triad that is verified, from an accelerometer's."""
        return names_of(self.plan).file(name)

    def render(self, name: str, template: str, context: dict[str, Any]) -> Path:
        """Write a template's text under `name` and return its path."""
        path = self.folder / name
        shape = self.plan.shape
        known = {"shape": shape, **names_of(self.plan).context, **context}
        path.write_text(environment().get_template(template).render(known), encoding="utf-8")
        return path

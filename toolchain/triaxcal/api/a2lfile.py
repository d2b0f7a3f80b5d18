"""The A2L of the constants in a linked program, of a unit or an IMU."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.elf import linked_constants
from triaxcal.codegen.names import names_of
from triaxcal.fixedpoint.plan import Plan
from triaxcal.report.a2l import Triad, XcpOnCan, linked_a2l
from triaxcal.unit.thermometer import TemperatureSensor


def xcp_on_can(can_ids: tuple[int, int] | None, bitrate: int | None) -> XcpOnCan | None:
    """How a tool reaches the device; None leaves it to the tool.

    Raises
    ------
    RefusedError
        For a bit rate without identifiers.
    """
    if can_ids is None and bitrate is not None:
        raise RefusedError("bitrate", "stated", expected="CAN identifiers as well")
    return None if can_ids is None else XcpOnCan(*can_ids, bitrate)


def write_linked_a2l(
    elf: str | Path,
    path: str | Path | None,
    triads: Sequence[tuple[Plan, TemperatureSensor]],
    provenance: Provenance,
    *,
    variables: Sequence[str],
    xcp: XcpOnCan | None,
) -> Path:
    """Write the A2L of triads; `variables` are those that they are loaded into, or none.

    Raises
    ------
    RefusedError
        As `Firmware.write_a2l`.
    """
    program = Path(elf)
    if variables and len(variables) != len(triads):
        parts = ", ".join(f"{names_of(plan).triad}_calib_t" for plan, _ in triads)
        raise RefusedError(
            "variable", f"found {', '.join(variables)}", expected=f"one for each of {parts}"
        )
    found = [
        Triad(
            plan,
            sensor,
            provenance.inputs_sha256,
            linked_constants(program, plan, provenance, variable),
        )
        for (plan, sensor), variable in zip(triads, variables or (None, None), strict=False)
    ]
    name = names_of(triads[0][0]).file("triax_calib.a2l")
    target = program.with_name(name) if path is None else Path(path)
    renew({target.name: linked_a2l(found, provenance, xcp)}, target.parent)
    return target

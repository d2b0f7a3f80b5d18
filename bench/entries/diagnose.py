"""The diagnosis of a unit on a tilter: all causes against its readings."""

from __future__ import annotations

from measuring import UNITS, Bench, Figure, alternately, pick

from triaxcal.delivery.fitted import fit_folder
from triaxcal.diagnosis import diagnose
from triaxcal.unit.description import read_unit


def measure(size: str) -> list[Figure]:
    folder = UNITS / "AT-SIM"
    unit = read_unit(folder)
    fitted = fit_folder(unit, folder)
    diagnose(unit, fitted.measurements)
    found, fit = alternately(
        pick(size, 1, 5, 15),
        lambda: diagnose(unit, fitted.measurements),
        lambda: fit_folder(unit, folder),
    )
    return [Figure(_DIAGNOSIS, found, "CPU s", "the fit of the same readings", fit)]


_DIAGNOSIS = "diagnosis of AT-SIM"
ENTRY = Bench(
    name="diagnose",
    label="Diagnosis",
    doc="Every cause at every place against a sound unit: 78 dwells, 36 of them check dwells. In "
    "`calib` it runs only where readings are doubtful.",
    measure=measure,
    figures=(_DIAGNOSIS,),
    rank=30,
)

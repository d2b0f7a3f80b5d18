"""`verify_unit` and `certify`: external tools check the delivered C and the proof of its bound."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.progress import Progress
from triaxcal.base.publish import publish, renew
from triaxcal.base.tomltable import has_table
from triaxcal.delivery.imu import deliver_described, refuse_no_device
from triaxcal.delivery.unit import deliver
from triaxcal.device.record import read_record, record_path
from triaxcal.dynamic.description import read_dynamic
from triaxcal.report.dynamic import dynamic_files
from triaxcal.report.dynamicpage import dynamic_page
from triaxcal.report.files import SOMETIMES, all_files, passport_files
from triaxcal.report.imuc import C_FILES
from triaxcal.report.passport.content import passport
from triaxcal.unit.folder import find_unit
from triaxcal.verify import certificate
from triaxcal.verify.campaign import delivery_outcomes, exit_code, verify_files
from triaxcal.verify.certificate_readme import certificate_readme
from triaxcal.verify.imu import imu_delivery_outcomes, triads, verify_imu
from triaxcal.verify.outcome import Outcome
from triaxcal.verify.record import entries, is_delivered, record, refuse_edited
from triaxcal.verify.table import table
from triaxcal.verify.workspace import Workspace

Groups = Mapping[str, Sequence[Outcome]]
"""Outcomes of each part of the C; an accelerometer alone is the part ""."""


@dataclass(frozen=True)
class Verification:
    """What the tools found.

    Attributes
    ----------
    folder : Path
        Of the delivery; its verification.json has the outcomes.
    outcomes : tuple of Outcome
        One a check; the checks of a missing tool count as not done.
    failed : bool
        Whether a check failed.
    summary : str
        The table that the command line prints.
    certificates : Path or None
        Folder of the files that Coq accepted.
    """

    folder: Path
    outcomes: tuple[Outcome, ...]
    failed: bool
    summary: str
    certificates: Path | None = None


@dataclass(frozen=True)
class _Delivered:
    """A delivery in place, and how its parts are verified.

    Attributes
    ----------
    verify : callable
        Runs every check in a folder.
    workspaces : callable
        Each part's files in a folder.
    before : mapping
        What the delivery itself has proven.
    renew : callable
        Writes the passport with the section "tools" of verification.json.
    """

    name: str
    target: Path
    verify: Callable[[Path], Groups]
    workspaces: Callable[[Path], Mapping[str, Workspace]]
    before: Groups
    renew: Callable[[Mapping[str, Any]], None]

    def keep(self, groups: Groups) -> None:
        """Outcomes into verification.json and the passport."""
        found: dict[str, Any] = {name: entries(outcomes) for name, outcomes in groups.items()}
        self.renew(record(self.target, found.pop("", {}) | found))

    def verification(
        self, groups: Groups, shown: Groups, certificates: Path | None = None
    ) -> Verification:
        """The result, with the table of what is shown."""
        outcomes = tuple(outcome for found in groups.values() for outcome in found)
        rows = table({name.replace("_", " "): found for name, found in shown.items()})
        failed = exit_code(outcomes) != 0
        text = f"unit {self.name}\n\n{rows}"
        return Verification(self.target, outcomes, failed, text, certificates)


def verify_unit(
    folder: str | Path, build: str | Path = "build", progress: Progress | None = None
) -> Verification:
    """Deliver a unit, then check its C with Gappa, Frama-C, cppcheck, gcc and clang.

    A delivery that is there already and equal is kept. The outcomes go into verification.json and
    the passport.

    Raises
    ------
    RefusedError
        As `deliver`; for an IMU without [device]; where a delivered file was changed since.
    """
    delivered = _deliver(Path(folder), Path(build), progress)
    with tempfile.TemporaryDirectory(prefix="triaxcal-verify-") as work:
        groups = delivered.verify(Path(work))
    delivered.keep(groups)
    shown = {name: [*delivered.before[name], *found] for name, found in groups.items()}
    return delivered.verification(groups, shown)


def certify(
    folder: str | Path, build: str | Path = "build", progress: Progress | None = None
) -> Verification:
    """Deliver a unit, then prove its error bound in Coq.

    One theorem for each axis and segment, in the integers of the specification, goes into
    build/certificates/<unit>/ when Coq has accepted all of them. verification.json and the passport
    get their hashes. docs/explanation/certificate.md explains what is proven.

    Raises
    ------
    RefusedError
        As `verify_unit`.
    """
    delivered = _deliver(Path(folder), Path(build), progress)
    groups: dict[str, Sequence[Outcome]] = {}
    files: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory(prefix="triaxcal-certify-") as work:
        for name, workspace in delivered.workspaces(Path(work)).items():
            outcome, proofs = certificate.certify(workspace, name, progress)
            groups[name] = [outcome]
            files |= proofs
    delivered.keep(groups)
    place = Path(build) / "certificates" / delivered.name
    if files:
        readme = certificate_readme(delivered.name, groups)
        publish({**files, "README.txt": readme}, place, ["*.v"])
    return delivered.verification(groups, groups, place if files else None)


def _deliver(unit: Path, build: Path, progress: Progress | None) -> _Delivered:
    if has_table(find_unit(unit), "dynamic"):
        return _deliver_imu(unit, build, progress)
    delivery = deliver(unit)
    target = build / delivery.unit.name
    device = read_record(record_path(target))
    refuse_edited(target)
    files = all_files(delivery, passport(delivery, {}, device))
    if not is_delivered(target, files):
        publish(files, target, SOMETIMES)
    parts = delivery.files, delivery.plan, delivery.bound, delivery.firmware.angles
    return _Delivered(
        delivery.unit.name,
        target,
        verify=lambda work: {"": verify_files(work, *parts)},
        workspaces=lambda work: {"": Workspace.create(work, *parts)},
        before={"": delivery_outcomes(delivery.bound, delivery.check)},
        renew=lambda tools: renew(passport_files(passport(delivery, tools, device)), target),
    )


def _deliver_imu(unit: Path, build: Path, progress: Progress | None) -> _Delivered:
    described = read_dynamic(unit)
    refuse_no_device(described)
    target = build / described.name
    refuse_edited(target)  # before minutes of filtering, not after
    made = deliver_described(described, progress)
    assert made.c is not None
    built = made.c.build
    files = dynamic_files(made)
    if not is_delivered(target, files):
        publish(files, target, C_FILES)
    return _Delivered(
        made.done.unit.name,
        target,
        verify=lambda work: verify_imu(work, built),
        workspaces=lambda work: triads(work, built),
        before=imu_delivery_outcomes(built),
        renew=lambda tools: renew({"dynamic.html": dynamic_page(made, tools)}, target),
    )

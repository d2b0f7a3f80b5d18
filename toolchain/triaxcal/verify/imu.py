"""Every check of the C of an IMU: of each triad alone, and of both together.

The routines of the triads are those of one template, so each goes through the checks of an
accelerometer's delivery. triax_imu.c calls them one after the other; what it adds is analysed here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from triaxcal.base.shipped import shipped
from triaxcal.codegen.identity import IDENTITY_SIZE
from triaxcal.codegen.imu import IMU_FILES, IMU_IMAGE_FILE, ImuBuild, imu_answers, imu_vectors
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import render_routine
from triaxcal.codegen.shim import write_shim
from triaxcal.codegen.templates import environment
from triaxcal.unit.arithmetic import LIMBS, PORTABLE
from triaxcal.verify import analyzers, cppcheck, eva, wp, wp_imu
from triaxcal.verify.campaign import delivery_outcomes, guarded, verify_work
from triaxcal.verify.image_reader import image_length
from triaxcal.verify.outcome import Outcome
from triaxcal.verify.workspace import (
    CONSTANTS,
    IMAGE,
    ROUTINE,
    SELFTEST,
    SHIM,
    Workspace,
    host_forms,
)

ACCELEROMETER, GYRO, BOTH = "accelerometer", "gyro", "both_triads"
_DRIVER = "verify_eva_imu.c"


@dataclass(frozen=True)
class Both:
    """Files of an IMU on disk, and its plans."""

    folder: Path
    build: ImuBuild

    @classmethod
    def create(cls, folder: Path, build: ImuBuild) -> Both:
        """Write the delivered files into `folder`."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in build.files.items():
            (folder / name).write_bytes(content)
        for plan in (build.accel, build.gyro):
            texts = render_routine(replace(plan, arithmetic=LIMBS))
            for name in host_forms(plan).values():
                (folder / name).write_text(texts[name], encoding="utf-8")
        write_shim(folder / SHIM, build.accel.prefix)
        return cls(folder, build)

    def render(self, name: str, template: str, context: Mapping[str, object]) -> Path:
        """Write a template's text under `name` and return its path."""
        path = self.folder / name
        known = {**names_of(self.build.accel).context, **context}
        path.write_text(environment().get_template(template).render(known), encoding="utf-8")
        return path

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the C files, that of both triads first."""
        return self.sources_in(PORTABLE)

    def sources_in(self, form: str) -> tuple[str, ...]:
        """The same with the routines in a form, where their shape has it."""
        plans = self.build.accel, self.build.gyro
        own = names_of(plans[0]).file("triax_imu.c")
        routines = [host_forms(plan).get(form, names_of(plan).file(ROUTINE)) for plan in plans]
        return own, *routines, *(names_of(plan).file(CONSTANTS) for plan in plans)

    @property
    def selftests(self) -> tuple[str, ...]:
        """Names of the C files of the self-tests."""
        plans = self.build.accel, self.build.gyro
        return tuple(names_of(plan).file(SELFTEST) for plan in plans)


def verify_imu(folder: Path, build: ImuBuild) -> dict[str, tuple[Outcome, ...]]:
    """Run every check on the C of an IMU; `folder` is for the work and stays behind.

    Returns
    -------
    dict
        Outcomes of `ACCELEROMETER`, `GYRO` and `BOTH`.
    """
    outcomes = {name: verify_work(work) for name, work in triads(folder, build).items()}
    return {**outcomes, BOTH: _verify_both(folder / "both", build)}


def triads(folder: Path, build: ImuBuild) -> dict[str, Workspace]:
    """Files of `ACCELEROMETER` and `GYRO`, each in a folder of its own."""
    image = build.files[names_of(build.accel).file(IMU_IMAGE_FILE)]
    length = image_length(image) + IDENTITY_SIZE
    accel = {**build.files, names_of(build.accel).file(IMAGE): image[:length]}
    gyro = {**build.files, names_of(build.gyro).file(IMAGE): image[length:]}
    parts = build.accel, build.accel_bound, build.angles
    return {
        ACCELEROMETER: Workspace.create(folder / "accel", accel, *parts),
        GYRO: Workspace.create(folder / "gyro", gyro, build.gyro, build.gyro_bound),
    }


def imu_delivery_outcomes(build: ImuBuild) -> dict[str, tuple[Outcome, ...]]:
    """What the delivery itself has proven and compared, of each triad."""
    return {
        ACCELEROMETER: delivery_outcomes(build.accel_bound, build.accel_check),
        GYRO: delivery_outcomes(build.gyro_bound, build.gyro_check),
        BOTH: (),
    }


def _verify_both(folder: Path, build: ImuBuild) -> tuple[Outcome, ...]:
    work = Both.create(folder, build)
    with ThreadPoolExecutor(2) as pool:
        return tuple(pool.map(lambda c: guarded(c[0], c[1], lambda: c[2](work)), CHECKS))


def _eva(work: Both, key: str, title: str, entry: str, form: str) -> Outcome:
    driver = work.render(f"{key}_{_DRIVER}", "verify/eva_imu.c.j2", _ranges(work.build))
    ends = {entry, "sample" if entry == "verify_imu_codes" else "accepted"}
    sources = eva.without_contracts(work.folder, key, work.sources_in(form))
    asked = eva.Analysis(key, title, entry, ends, (*sources, driver.name))
    return eva.analyse(work.folder, asked)


def _ranges(build: ImuBuild) -> dict[str, object]:
    """Ranges of both triads, in equal number: the shorter list repeats its last one."""
    lists = [eva.range_literals(plan) for plan in (build.accel, build.gyro)]
    count = max(map(len, lists))
    accel, gyro = (ranges + ranges[-1:] * (count - len(ranges)) for ranges in lists)
    own = {"two_thermometers": build.two_thermometers}
    return {"accel_ranges": accel, "gyro_ranges": gyro, "count": count, **own}


def _cppcheck(work: Both) -> Outcome:
    """triax_imu.c and its header; the findings in the files of the triads are theirs."""
    own = {names_of(work.build.accel).file(name) for name in IMU_FILES}
    found = cppcheck.find_in(
        work.folder, (*work.sources, *work.selftests), [work.build.accel, work.build.gyro]
    )
    return cppcheck.judge([finding for finding in found if finding.file in own])


def _sanitizer(work: Both, sanitizer: analyzers.Sanitizer) -> Outcome:
    build = work.build
    samples = imu_vectors(build.accel, build.gyro, two_thermometers=build.two_thermometers)
    temp, raw_accel, raw_gyro, gyro_temp = samples
    accel, rate, status = imu_answers(build.accel, build.gyro, samples)
    answers = np.column_stack([accel, rate, status.view(np.int32)]).astype(np.int32).tobytes()
    subject = analyzers.Subject(
        work.folder,
        work.render(f"verify_{sanitizer.key}.c", "verify/driver_imu.c.j2", {}),
        {
            form: (*work.sources_in(form), str(shipped("firmware_ref") / "triax_imu_batch.c"))
            for form in (PORTABLE, LIMBS)
        },
        names_of(build.accel).file(IMU_IMAGE_FILE),
        np.column_stack([temp, gyro_temp, raw_accel, raw_gyro]).astype(np.int32).tobytes(),
        answers * 2,
    )
    return analyzers.run_sanitizer(sanitizer, subject, len(temp))


CHECKS: tuple[tuple[str, str, Callable[[Both], Outcome]], ...] = (
    *(
        (key, title, lambda w, k=key, t=title, e=entry, f=form: _eva(w, k, t, e, f))
        for key, title, entry, form in (
            ("eva_codes", "Eva: any int32 codes", "verify_imu_codes", PORTABLE),
            ("eva_codes_limbs", "Eva: any codes, limbs", "verify_imu_codes", LIMBS),
            ("eva_image", "Eva: any image", "verify_imu_image", PORTABLE),
        )
    ),
    (wp.KEY, wp.TITLE, lambda w: wp_imu.check(w.folder, w.build)),
    ("cppcheck", "cppcheck: MISRA C:2012", _cppcheck),
    (
        "gcc_analyzer",
        "gcc -fanalyzer",
        lambda w: analyzers.analyse_with_gcc(w.folder, {PORTABLE: w.sources[0]}),
    ),
    *(
        (sanitizer.key, sanitizer.title, lambda w, s=sanitizer: _sanitizer(w, s))
        for sanitizer in analyzers.SANITIZERS
    ),
)
"""Key, title and function of each check of both triads together."""

"""The end of a session at the bench: the flashed device in its check positions.

Not in `import triaxcal`: it needs the packages of `triaxcal[device]`.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.codegen.crosscheck import python_routine
from triaxcal.codegen.names import names_of
from triaxcal.delivery.unit import Delivery
from triaxcal.device.link import Link
from triaxcal.device.positions import Expected, at_positions
from triaxcal.device.record import (
    DeviceRecord,
    read_record,
    record_bytes,
    record_path,
    sha256_of,
)
from triaxcal.device.rest import Allowed
from triaxcal.device.unit import require_in_use
from triaxcal.model.positions import CHECK_POSITIONS
from triaxcal.report.files import CERTIFICATE, all_files
from triaxcal.report.passport.content import passport
from triaxcal.unit.site import STANDARD_GRAVITY_M_PER_S2
from triaxcal.unit.thermal import near_t0
from triaxcal.verify.record import RENEWED, is_delivered, tools_of


def require_delivered(delivery: Delivery, target: Path) -> None:
    """Refuse a folder that has not this delivery.

    Raises
    ------
    RefusedError
        When its files are others.
    """
    made = passport(delivery, {}, read_record(record_path(target)))
    if not is_delivered(target, all_files(delivery, made)):
        raise RefusedError(
            str(target),
            "not this calibration" if target.is_dir() else "no such folder",
            expected=f"the files of {delivery.unit.name} as it is now",
            remedy="run `triaxcal calib` first, and flash the device",
        )


def allowed_length(delivery: Delivery, temp_code: float) -> Allowed:
    """What |a| - g may be at the temperature of a code."""
    unit, uncertainty = delivery.unit, delivery.firmware.uncertainty
    temp_degc = unit.temperature_sensor.degc(temp_code)
    at_t0_g, over_range_g = uncertainty.length_g
    near = near_t0(temp_degc, unit.t0_degc)
    limit_g, _ = unit.limits.at(temp_degc, unit.t0_degc)
    return Allowed(limit_g, at_t0_g if near else over_range_g)


def verify_at_positions(  # noqa: PLR0917
    link: Link,
    delivery: Delivery,
    target: Path,
    count: int,
    samples: int,
    place: Callable[[str, str], None],
    gravity_m_per_s2: float | None = None,
    day: datetime.date | None = None,
) -> DeviceRecord:
    """Verify a flashed device in check positions; the record goes beside the delivery.

    Passport and certificate of the delivery state it from then on.

    Parameters
    ----------
    link : Link
        The device.
    delivery : Delivery
        What it must have in use.
    target : Path
        Folder of the delivery.
    count : int
        Check positions, 1 to 6.
    samples : int
        In each position.
    place : callable
        As `at_positions` has it.
    gravity_m_per_s2 : float or None
        Local gravity where it is verified; None is that of the unit.
    day : date or None
        None is today, UTC.

    Raises
    ------
    RefusedError
        When the device has another calibration or serial number, a bit differs, or |a| - g is
        beyond the limit; nothing is written then.
    """
    require_delivered(delivery, target)
    earlier = read_record(record_path(target))
    try:
        record = _verified(link, delivery, count, samples, place, gravity_m_per_s2, day)
    except RefusedError as error:
        if earlier is None:
            raise
        raise _beside(error, earlier) from error
    made = passport(delivery, tools_of(target), record)
    files = all_files(delivery, made)
    renewed = {name: files[name] for name in (*RENEWED, CERTIFICATE) if name in files}
    path = record_path(target)
    renew({path.name: record_bytes(record)}, path.parent)
    renew(renewed, target)
    return record


def _beside(error: RefusedError, earlier: DeviceRecord) -> RefusedError:
    """An error that says what it leaves: the passport still states the earlier record."""
    stays = f"the earlier record, of {earlier.date}, stays, and so does the passport"
    remedy = f"{error.remedy}; {stays}" if error.remedy else stays
    return type(error)(error.place, error.found, expected=error.expected, remedy=remedy)


def _verified(  # noqa: PLR0917
    link: Link,
    delivery: Delivery,
    count: int,
    samples: int,
    place: Callable[[str, str], None],
    gravity_m_per_s2: float | None,
    day: datetime.date | None,
) -> DeviceRecord:
    unit, plan = delivery.unit, delivery.plan
    image = delivery.files[names_of(plan).file("triax_calib.bin")]
    node = require_in_use(link, image, unit.name)
    gravity_g = unit.gravity_g
    if gravity_m_per_s2 is not None:
        gravity_g = gravity_m_per_s2 / STANDARD_GRAVITY_M_PER_S2
    expected = Expected(
        python_routine(plan),
        plan.shape.output_q,
        gravity_g,
        unit.temperature_sensor.degc,
        lambda degc: unit.limits.at(degc, unit.t0_degc)[0],
    )
    found = at_positions(link, expected, CHECK_POSITIONS[:count], samples, place)
    return DeviceRecord(
        unit=unit.name,
        serial=unit.serial,
        hardware=node.hardware,
        firmware=node.firmware,
        image_sha256=sha256_of(node.content),
        date=(day or datetime.datetime.now(datetime.UTC).date()).isoformat(),
        gravity_m_per_s2=gravity_g * STANDARD_GRAVITY_M_PER_S2,
        largest_difference_lsb=0,  # another one is refused
        positions=tuple(found),
    )

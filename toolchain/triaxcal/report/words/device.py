"""What is said of a device that was verified."""

from __future__ import annotations

from triaxcal.device.record import DeviceRecord
from triaxcal.report.words.numbers import g_in_words, thousands


def device_words(record: DeviceRecord) -> str:
    """A device with this delivery: serial number, day, bits, and |a| - g at its positions."""
    serial = record.hardware or record.serial
    worst = record.worst
    count = len(record.positions)
    where = f"{count} check position{'s' if count > 1 else ''}"
    of_limit = f" (limit {g_in_words(worst.limit_g)})"
    return (
        f"verified on device {serial}, {record.date}, {record.firmware or 'no version stated'}: "
        f"{thousands(record.samples)} samples, largest difference "
        f"{record.largest_difference_lsb} LSB; | |a| − g | at most "
        f"{g_in_words(abs(worst.error_g))} at {where}{of_limit}"
    )

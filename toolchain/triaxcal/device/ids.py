"""CAN ids of a node: 11 bits, or 29 bits with bit 31, as pyxcp and ASAP2 have them."""

from __future__ import annotations

from triaxcal.base.errors import UsageError

_EXTENDED = 1 << 31
_LAST_STANDARD, _LAST_EXTENDED = 0x7FF, 0x1FFFFFFF


def node_ids(request_id: int, response_id: int) -> tuple[int, int]:
    """Both ids, which are two different ones.

    Raises
    ------
    UsageError
        For what is no id, and for the same one twice.
    """
    for option, value in (("--request-id", request_id), ("--response-id", response_id)):
        if not (0 <= value <= _LAST_STANDARD or 0 <= value - _EXTENDED <= _LAST_EXTENDED):
            plain = _LAST_STANDARD < value <= _LAST_EXTENDED
            raise UsageError(
                option,
                f"found {value:#x}",
                expected="0 to 0x7ff, or a 29-bit id with bit 31 set"
                + (f": {value | _EXTENDED:#x}" if plain else ""),
            )
    if request_id == response_id:
        raise UsageError(
            "--response-id", f"found {response_id:#x}", expected="another id than --request-id"
        )
    return request_id, response_id

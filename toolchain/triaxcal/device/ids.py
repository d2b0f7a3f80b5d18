"""CAN ids of a node: 11 bits, or 29 bits with bit 31, as pyxcp and ASAP2 have them."""

from __future__ import annotations

from triaxcal.base.errors import UsageError

_EXPECTED = "0 to 0x7ff, or a 29-bit id with bit 31 set"
_EXTENDED = 1 << 31
_LAST_STANDARD, _LAST_EXTENDED = 0x7FF, 0x1FFFFFFF


def is_node_id(value: int) -> bool:
    """Whether a number is an id: of 11 bits, or of 29 bits with bit 31."""
    return 0 <= value <= _LAST_STANDARD or 0 <= value - _EXTENDED <= _LAST_EXTENDED


def expected_for(value: int) -> str:
    """What is expected in place of a number that is no id."""
    plain = _LAST_STANDARD < value <= _LAST_EXTENDED
    return _EXPECTED + (f": {value | _EXTENDED:#x}" if plain else "")


def node_ids(request_id: int, response_id: int) -> tuple[int, int]:
    """Both ids, which are two different ones.

    Raises
    ------
    UsageError
        For what is no id, and for the same one twice.
    """
    for option, value in (("--request-id", request_id), ("--response-id", response_id)):
        if not is_node_id(value):
            raise UsageError(option, f"found {value:#x}", expected=expected_for(value))
    if request_id == response_id:
        raise UsageError(
            "--response-id", f"found {response_id:#x}", expected="another id than --request-id"
        )
    return request_id, response_id

"""Random messages of bus descriptions, and their frames by cantools."""

from __future__ import annotations

import cantools
import numpy as np
from cantools.database.can import Database, Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import strategies as st

SCALES = (1, 2, -3, 0.5, 0.001, 0.000127465, 1.0 / 3.0, 65536, 1e-9)
OFFSETS = (0, 100, -40, -4.1768, 0.25, 1e9)


@st.composite
def messages(draw, number=1):
    """A message of any length with signals of every kind, some of them multiplexed."""
    fd = draw(st.booleans())
    size = draw(st.sampled_from((8, 12, 16, 24, 48, 64) if fd else tuple(range(1, 9))))
    extended = draw(st.booleans())
    frame_id = draw(st.integers(0, (1 << (29 if extended else 11)) - 1))
    count = draw(st.integers(1, 10))
    kept: list[Signal] = []
    selector = None
    for i in range(count):
        signal = draw(signals(f"S{i}", size, selector))
        try:
            Message(frame_id, "M", size, [*kept, signal], is_extended_frame=extended, is_fd=fd)
        except cantools.database.Error:
            continue  # no room for it
        kept.append(signal)
        small = not signal.is_float and signal.length <= 8
        if selector is None and small and draw(st.booleans()):
            # cantools compares the value of a multiplexer, other tools its raw number.
            signal.conversion = BaseConversion.factory()
            signal.is_multiplexer = True
            selector = signal.name
    return Message(
        frame_id, f"M{number}", size, kept, is_extended_frame=extended, is_fd=fd, strict=True
    )


@st.composite
def signals(draw, name, size, selector):
    """One signal, anywhere in the payload."""
    is_float = draw(st.integers(0, 3)) == 0
    length = draw(st.sampled_from((32, 64))) if is_float else draw(st.integers(1, 64))
    scale, offset = draw(st.sampled_from(SCALES)), draw(st.sampled_from(OFFSETS))
    multiplexed = selector is not None and draw(st.booleans())
    cases = draw(st.lists(st.integers(0, 3), min_size=1, max_size=2, unique=True))
    return Signal(
        name,
        draw(st.integers(0, 8 * size - 1)),
        length,
        byte_order=draw(st.sampled_from(("little_endian", "big_endian"))),
        is_signed=not is_float and draw(st.booleans()),
        conversion=BaseConversion.factory(scale, offset, None, is_float),
        multiplexer_signal=selector if multiplexed else None,
        multiplexer_ids=sorted(cases) if multiplexed else None,
    )


def payloads(message, count, seed):
    """Random payloads (count, bytes); the first cases of a multiplexer come often."""
    rng = np.random.default_rng(seed)
    data = rng.integers(0, 256, (count, message.length), dtype=np.uint8)
    selectors = {s.multiplexer_signal for s in message.signals} - {None}
    for name in selectors:
        masks = _bits_of(message, name)
        data &= ~np.bitwise_or.reduce(masks, axis=0)
        for row, value in enumerate(rng.integers(0, 4, count)):
            for bit, mask in enumerate(masks):
                if value >> bit & 1:
                    data[row] |= mask
    return data


def _bits_of(message, name):
    """What each bit of an integer signal is in the payload, by cantools."""
    signal = message.get_signal_by_name(name)
    top = signal.length - 1
    alone = Message(1, "A", message.length, [signal], strict=False, is_fd=message.length > 8)
    values = (-(1 << b) if signal.is_signed and b == top else 1 << b for b in range(signal.length))
    rows = [alone.encode({name: v}, scaling=False, strict=False) for v in values]
    return np.array([list(row) for row in rows], np.uint8)


def decoded(message, payload, scaling):
    """Numbers of a payload by cantools; None where it knows no such case of a multiplexer."""
    try:
        return message.decode(payload, decode_choices=False, scaling=scaling)
    except cantools.database.DecodeError:
        return None


def database_of(*messages):
    return Database(messages=list(messages), strict=True)

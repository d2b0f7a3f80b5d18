"""triax_calib.bin: its bytes by the page, and what the two loaders must refuse."""

from __future__ import annotations

import ctypes
import re
import struct
import subprocess
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from builds import Builds, Built
from plans import COVERING, GOLDEN, INT32_MAX, INT32_MIN, disturbed, random_plan
from triaxcal import __version__
from triaxcal.base.errors import RefusedError
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.identity import Identity, identity_of, with_identity
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.image_cases import image_cases
from triaxcal.codegen.names import names_of
from triaxcal.codegen.routines import Reference
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.thermometer import TemperatureSensor

NOTHING = np.zeros(0, np.int32), np.zeros((0, 3), np.int32)
OK, BAD = 0, 16
SAMPLES = ["direct-cubic-24-bit", "direct-32-bit-two-segments", "inverse-32-bit-three-segments"]


def crc32_by_the_bit(data: bytes) -> int:
    """IEEE 802.3, bit by bit: reflected, started and ended with ones."""
    crc = 0xFFFFFFFF
    for byte in data:
        for bit in range(8):
            out = (crc ^ (byte >> bit)) & 1
            crc = (crc >> 1) ^ (0xEDB88320 if out else 0)
    return crc ^ 0xFFFFFFFF


def with_crc(payload: bytes) -> bytes:
    return payload + crc32_by_the_bit(payload).to_bytes(4, "little")


def words_of(image: bytes) -> list[int]:
    return list(struct.unpack(f"<{len(image) // 4}i", image))


def image_of(words: list[int]) -> bytes:
    """Image of words without the CRC, which is added."""
    return with_crc(struct.pack(f"<{len(words)}i", *words))


def load(built: Built, image: bytes) -> int:
    return built.generated.run_image(image, *NOTHING)[0]


def opens(reference: Reference, image: bytes) -> bool:
    try:
        reference.routine(image)(*NOTHING)
    except RefusedError as refusal:
        if "the image was refused" not in str(refusal):
            raise
        return False
    return True


# ---- what it holds ----


@pytest.mark.parametrize("name", [*COVERING, *GOLDEN])
def test_image_is_the_page(built: dict[str, Built], reference: Reference, name: str) -> None:
    plan = built[name].plan
    image = image_bytes(plan)
    assert image[:4] == b"TRXC"
    assert crc32_by_the_bit(image[:-4]).to_bytes(4, "little") == image[-4:]
    words = words_of(image)
    shape = plan.shape
    word = (plan.quadratic is not None) + 8 * shape.high_words
    terms = [word] if word else []
    assert words[1:3] == [1 + len(terms), len(image)]
    i = shape.inverse
    assert words[3:15] == [
        {"direct": 0, "inverse": 1}[shape.form],
        shape.segments,
        shape.order,
        shape.output_q,
        shape.output_shift,
        shape.raw_min,
        shape.raw_max,
        shape.raw_shift,
        i.adjugate_shift if i else 0,
        i.determinant_shift if i else 0,
        i.reciprocal_log2 if i else 0,
        i.gain_shift if i else 0,
    ]
    at = 15 + len(terms)
    assert words[15:at] == terms
    assert words[at : at + 2] == [plan.temp_min_code, plan.temp_max_code]
    at += 2
    for segment in plan.segments:
        assert words[at : at + 3] == [segment.first_code, segment.origin_code, segment.gain]
        at += 3
        for row in segment.coefficients.tolist():
            assert words[at : at + len(row)] == row
            at += len(row)
    if plan.quadratic is not None:
        assert words[at : at + 18] == plan.quadratic.ravel().tolist()
        at += 18
    assert at == len(words) - 1
    assert load(built[name], image) == OK
    assert opens(reference, image)


def test_crc_of_the_check_string() -> None:
    assert crc32_by_the_bit(b"123456789") == 0xCBF43926  # the published check value


# ---- damage ----


@pytest.mark.parametrize("name", SAMPLES)
def test_truncated_at_any_length_is_refused(
    built: dict[str, Built], reference: Reference, name: str
) -> None:
    image = built[name].image
    for size in range(len(image)):
        assert load(built[name], image[:size]) == BAD, size
        assert not opens(reference, image[:size]), size
    for more in (1, 3, 4, 8, 64):
        assert load(built[name], image + bytes(more)) == BAD
        assert not opens(reference, image + bytes(more))


@pytest.mark.parametrize("name", SAMPLES)
def test_every_single_bit_flip_is_refused(
    built: dict[str, Built], reference: Reference, name: str
) -> None:
    image = built[name].image
    for bit in range(8 * len(image)):
        damaged = bytearray(image)
        damaged[bit // 8] ^= 1 << (bit % 8)
        assert load(built[name], bytes(damaged)) == BAD, bit
        assert not opens(reference, bytes(damaged)), bit


@pytest.mark.parametrize("fill", [b"\x00", b"\xff", b"\x55"])
def test_erased_flash_is_refused(
    built: dict[str, Built], reference: Reference, fill: bytes
) -> None:
    for name in SAMPLES:
        erased = fill * len(built[name].image)
        assert load(built[name], erased) == BAD
        assert load(built[name], with_crc(erased[:-4])) == BAD
        assert not opens(reference, with_crc(erased[:-4]))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in SAMPLES else pytest.mark.long)
        for name in (*COVERING, *GOLDEN)
    ],
)
def test_images_of_every_other_shape_are_refused(built: Builds, name: str) -> None:
    for other, donor in built.plans.items():
        same = donor.shape == built[name].plan.shape
        assert load(built[name], image_bytes(donor)) == (OK if same else BAD), other


@pytest.mark.parametrize("name", SAMPLES)
def test_a_changed_header_with_a_right_crc_is_refused(built: dict[str, Built], name: str) -> None:
    words = words_of(built[name].image)[:-1]
    for index in range(15):
        for change in (-1, 1, 256, 2**24):
            changed = list(words)
            changed[index] = (words[index] + change + 2**31) % 2**32 - 2**31
            assert load(built[name], image_of(changed)) == BAD, index


@pytest.mark.parametrize(
    ("index", "value"),
    [(1, 2), (2, 0), (3, 2), (4, 0), (4, 65), (5, -1), (5, 10), (7, 0), (7, 63), (10, 32)],
)
def test_the_reference_refuses_what_no_shape_has(
    built: dict[str, Built], reference: Reference, index: int, value: int
) -> None:
    words = words_of(built["direct-cubic-24-bit"].image)[:-1]
    words[index] = value
    assert not opens(reference, image_of(words))


# ---- constants that could overflow, with a right CRC ----


def change(plan: Plan, index: int, value: int) -> bytes:
    """Image of a plan with one word after the header changed, and a right CRC."""
    words = words_of(image_bytes(plan))[:-1]
    words[15 + index] = value
    return image_of(words)


def coefficient_index(plan: Plan, s: int, f: int, k: int) -> int:
    terms = plan.shape.order + 1
    return 2 + s * (3 + 12 * terms) + 3 + f * terms + k


@pytest.mark.parametrize(
    ("what", "index", "value"),
    [
        ("ends exchanged", 0, 8961),
        ("a first code that is not the lower end", 0, -5121),
        ("x beyond Q31 at the upper end", 1, 1920 + 8192),
        ("x beyond Q31 at the upper end by far", 1, INT32_MAX),
        ("an origin far below", 3, INT32_MIN),
        ("an origin far above", 3, INT32_MAX),
        ("no gain", 4, 0),
        ("a negative gain", 4, -262_144),
        ("the most negative gain", 4, INT32_MIN),
        ("twice the gain", 4, 524_288),
        ("the largest gain", 4, INT32_MAX),
        ("a constant of INT32_MIN", 5, INT32_MIN),
        ("a constant of INT32_MAX", 5, INT32_MAX),
        ("a last coefficient of INT32_MIN", 7, INT32_MIN),
    ],
)
def test_constants_that_could_overflow_are_refused(
    built: dict[str, Built], what: str, index: int, value: int
) -> None:
    plan = built["direct-checked"].plan
    assert words_of(image_bytes(plan))[15:20] == [-5120, 8960, -5120, 1920, 262_144]
    assert load(built["direct-checked"], change(plan, index, value)) == BAD, what


def test_row_sums_are_refused_at_the_limit_and_taken_below_it(built: dict[str, Built]) -> None:
    # Of the order 0, bounds are the constants: |n0| + |n1| + |n2| + 2 |b| < 2^32 - 8.
    plan = built["direct-order-0"].plan
    for axis in range(3):
        for signs in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
            for excess, status in ((-9, OK), (-8, BAD), (0, BAD)):
                words = words_of(image_bytes(plan))[:-1]
                row = [INT32_MAX * signs[0], 0, 0, signs[1] * (2**30 - 50)]
                row[1] = 2**32 + excess - INT32_MAX - 2 * (2**30 - 50)
                words[20 + 4 * axis : 24 + 4 * axis] = row
                assert load(built["direct-order-0"], image_of(words)) == status, (axis, excess)


def test_segments_out_of_order_are_refused(built: dict[str, Built]) -> None:
    name = "direct-left-justified-piecewise"
    plan = built[name].plan
    size = 3 + 12 * 2
    for second, third, status in (
        (0, 2560, OK),
        (2560, 0, BAD),
        (0, 0, BAD),
        (-5120, 2560, BAD),
        (-5121, 2560, BAD),
        (0, 8961, BAD),
        (INT32_MIN, 2560, BAD),
        (0, INT32_MAX, BAD),
    ):
        words = words_of(image_bytes(plan))[:-1]
        words[17 + size], words[17 + 2 * size] = second, third
        assert load(built[name], image_of(words)) == status, (second, third)


@settings(max_examples=200)
@given(
    name=st.sampled_from([*COVERING]),
    seed=st.integers(0, 2**32),
    over=st.one_of(st.integers(-3, 3), st.integers(INT32_MIN, INT32_MAX)),
)
def test_the_loader_keeps_step_r_exactly(
    built: dict[str, Built], name: str, seed: int, over: int
) -> None:
    """Constants at the limit of step R, one word moved: taken exactly when the page takes them."""
    rng = Random(seed)
    plan = disturbed(rng, random_plan(rng, COVERING[name], full=True), over)
    assert load(built[name], image_bytes(plan)) == (OK if oracle.keeps_step_r(plan) else BAD)


@settings(max_examples=100)
@given(name=st.sampled_from([*COVERING]), seed=st.integers(0, 2**32), count=st.integers(1, 40))
def test_any_words_with_a_right_crc_are_refused_or_harmless(
    built: dict[str, Built], name: str, seed: int, count: int
) -> None:
    # Whether "harmless" holds is for the sanitizers of test_generated_c; here nothing may crash.
    rng = Random(seed)
    words = words_of(built[name].image)[:-1]
    for _ in range(count):
        words[rng.randrange(15, len(words))] = rng.choice(
            [rng.randint(INT32_MIN, INT32_MAX), rng.randint(-100, 100), INT32_MIN, INT32_MAX]
        )
    temps = np.array([rng.randint(INT32_MIN, INT32_MAX) for _ in range(8)], np.int32)
    raws = np.array([[rng.randint(INT32_MIN, INT32_MAX)] * 3 for _ in range(8)], np.int32)
    loaded, _ = built[name].generated.run_image(image_of(words), temps, raws)
    assert loaded in (OK, BAD)


# ---- either endianness ----


@pytest.mark.parametrize("source", ["triax_comp.c", "triax_ref_image.c"])
def test_words_are_assembled_from_bytes(built: dict[str, Built], source: str) -> None:
    """No host word is read from the image, so the host's byte order cannot matter."""
    folder = built["direct-checked"].folder
    if source == "triax_ref_image.c":
        from triaxcal.base.shipped import shipped

        folder = shipped("firmware_ref")
    code = re.sub(r"/\*.*?\*/", "", (folder / source).read_text(encoding="utf-8"), flags=re.DOTALL)
    assert not re.search(r"\(\s*(const\s+)?u?int(16|32|64)_t\s*(const\s*)?\*\s*(const\s*)?\)", code)
    assert not re.search(r"\b(memcpy|memmove|union|htonl|ntohl|__BYTE_ORDER)", code)


@pytest.mark.parametrize("offset", [1, 2, 3])
def test_an_image_may_lie_at_any_address(built: dict[str, Built], offset: int) -> None:
    routine = built["direct-checked"]
    image = routine.image
    storage = ctypes.create_string_buffer(bytes(offset) + image, len(image) + 8)
    calib = ctypes.create_string_buffer(4 * (2 + 3 + 12 * 3))
    status = getattr(routine.generated.library, f"{names_of(routine.plan).linked}_calib_load")(
        calib, ctypes.c_void_p(ctypes.addressof(storage) + offset), ctypes.c_size_t(len(image))
    )
    assert status == OK
    # The words of the structure, in the host's own order.
    assert list(struct.unpack(f"={len(calib) // 4}i", calib.raw)) == words_of(image)[15:-1]


# ---- the identity behind the constants ----

SENSOR = TemperatureSensor(0.0625, -3.5)
HASH = "0123456789abcdef" * 4
PROVENANCE = Provenance("SN-0042", HASH, (), "2026-03-30", "-ACC2, ACC1, ACC3")


def identity_by_the_page(image: bytes) -> bytes:
    """docs/explanation/fixed-point.md, the table of the identity, field by field."""
    content = image + b"TRID" + (1).to_bytes(4, "little") + image[-4:]
    content += b"SN-0042" + bytes(57) + b"2026-03-30" + bytes(2) + bytes.fromhex(HASH)
    content += __version__.encode().ljust(16, b"\0") + b"-ACC2, ACC1, ACC3".ljust(96, b"\0")
    return with_crc(content + struct.pack("<dd", 0.0625, -3.5))


@pytest.mark.parametrize("name", SAMPLES)
def test_identity_is_the_page(built: dict[str, Built], reference: Reference, name: str) -> None:
    image = image_bytes(built[name].plan)
    file = with_identity(image, SENSOR, PROVENANCE)
    assert file == identity_by_the_page(image)
    assert load(built[name], file) == OK
    assert opens(reference, file)
    assert identity_of(image) is None
    assert identity_of(file) == Identity(
        "SN-0042", "2026-03-30", HASH, __version__, "-ACC2, ACC1, ACC3", 0.0625, -3.5
    )


def test_an_identity_of_other_constants_is_refused(
    built: dict[str, Built], reference: Reference
) -> None:
    """Its CRC alone would not tell: a CRC over a message and its own CRC is always the same."""
    plan = built[SAMPLES[0]].plan
    one, other = image_bytes(plan), image_bytes(replace(plan, temp_max_code=plan.temp_max_code - 1))
    mixed = one + with_identity(other, SENSOR, PROVENANCE)[len(other) :]
    assert crc32_by_the_bit(mixed[:-4]).to_bytes(4, "little") == mixed[-4:]
    assert load(built[SAMPLES[0]], mixed) == BAD
    assert not opens(reference, mixed)
    with pytest.raises(RefusedError, match="of other constants"):
        identity_of(mixed)


def test_a_damaged_file_names_what_is_damaged() -> None:
    image = image_bytes(GOLDEN["direct-checked"])
    file = with_identity(image, SENSOR, PROVENANCE)
    for at, text in ((40, "CRC of the constants"), (len(image) + 20, "CRC of the identity")):
        damaged = file[:at] + bytes([file[at] ^ 8]) + file[at + 1 :]
        with pytest.raises(RefusedError, match=text):
            identity_of(damaged)
    for cut in (b"", b"TRXC", file[:-1], file + b"0", bytes(400)):
        with pytest.raises(RefusedError, match=f"{len(cut)} bytes"):
            identity_of(cut)


def test_a_long_list_of_axes_is_cut_at_a_character() -> None:
    axes = "a" + "\N{GREEK SMALL LETTER ALPHA}" * 60
    provenance = replace(PROVENANCE, axes=axes)
    identity = identity_of(with_identity(image_bytes(GOLDEN["direct-checked"]), SENSOR, provenance))
    assert identity is not None
    assert identity.axes == axes[:48]


KEEP = """
#include <string.h>
#include "triax_calib.h"
/* 1: refused and as it was, by both functions alike; 2: accepted; 0: anything else. */
int keeps(const uint8_t *image, size_t size)
{
    triax_calib_t calib;
    triax_calib_t before;
    uint32_t status;
    memset(&calib, 0x55, sizeof calib);
    before = calib;
    status = triax_calib_load(&calib, image, size);
    if (triax_calib_check(image, size) != status) {
        return 0;
    }
    if (status == TRIAX_STATUS_OK) {
        return 2;
    }
    return memcmp(&calib, &before, sizeof calib) == 0;
}
"""


def test_a_refused_image_leaves_the_constants_as_they_were(
    built: dict[str, Built], tmp_path: Path
) -> None:
    """Damaged, cut, of other constants, or with constants that could overflow."""
    b = built["direct-cubic-24-bit"]
    good = with_identity(image_bytes(b.plan), SENSOR, PROVENANCE)
    source, library = tmp_path / "keep.c", tmp_path / "keep.so"
    source.write_text(KEEP)
    files = [source, *(b.folder / name for name in ("triax_comp.c", "triax_calib.c"))]
    command = ["gcc", "-shared", "-fPIC", f"-I{b.folder}", "-o", str(library), *map(str, files)]
    subprocess.run(command, check=True)
    keeps = ctypes.CDLL(str(library)).keeps
    assert keeps(good, ctypes.c_size_t(len(good))) == 2
    refused = [case for case in image_cases(b.plan, image_bytes(b.plan)) if not case.accepted]
    assert len(refused) > 500
    for case in refused:
        assert keeps(case.image, ctypes.c_size_t(len(case.image))) == 1, case.name

"""Files for production, read back by decoders of this file's own and by bincopy."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from click.testing import CliRunner

import triaxcal
from plans import GOLDEN
from triaxcal.base.extras import install_command
from triaxcal.cli.main import main
from triaxcal.codegen.constants import Provenance
from triaxcal.codegen.flashfile import Placed, flash_file
from triaxcal.codegen.identity import with_identity
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.names import shape_id
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.thermometer import TemperatureSensor

PLAN = GOLDEN["direct-checked"]
SENSOR = TemperatureSensor(0.0625, -3.5)
PROVENANCE = Provenance("SN-0042", "0123456789abcdef" * 4, (), "2026-03-30", "-ACC2, ACC1, ACC3")
Memory = dict[int, int]
"""Address and byte."""


def file_of(plan: Plan) -> bytes:
    return with_identity(image_bytes(plan), SENSOR, PROVENANCE)


def memory(content: bytes, address: int) -> Memory:
    return {address + k: byte for k, byte in enumerate(content)}


# ---- decoders, from the formats' own descriptions ----


def read_hex(text: str) -> Memory:
    """Intel's Hexadecimal Object File Format, revision A: records 00, 01, 04."""
    found: Memory = {}
    upper, ended = 0, False
    for line in text.splitlines():
        assert not ended, "nothing may follow the end record"
        assert line[0] == ":"
        record = bytes.fromhex(line[1:])
        count, offset, kind = record[0], int.from_bytes(record[1:3], "big"), record[3]
        data = record[4:-1]
        assert len(data) == count
        assert sum(record) % 256 == 0
        if kind == 0:
            assert offset + count <= 0x10000, "a record that wraps is read in different ways"
            found |= memory(data, (upper << 16) + offset)
        elif kind == 4:
            upper = int.from_bytes(data, "big")
        else:
            assert (kind, count) == (1, 0)
            ended = True
    assert ended
    return found


def read_srec(text: str) -> Memory:
    """Motorola S-records: S3 with 32-bit addresses, S5 with their count, S7 at the end."""
    found: Memory = {}
    kinds = []
    for line in text.splitlines():
        kind, record = line[:2], bytes.fromhex(line[2:])
        assert record[0] == len(record) - 1
        assert sum(record) % 256 == 255
        kinds.append(kind)
        if kind == "S3":
            found |= memory(record[5:-1], int.from_bytes(record[1:5], "big"))
        if kind == "S5":
            assert int.from_bytes(record[1:3], "big") == kinds.count("S3")
    assert kinds[-2:] == ["S5", "S7"]
    assert set(kinds[:-2]) == {"S3"}
    return found


def read_uf2(content: bytes, family: int | None) -> Memory:
    """The table of github.com/microsoft/uf2: 512-byte blocks, each on its own."""
    found: Memory = {}
    assert len(content) % 512 == 0
    for k in range(len(content) // 512):
        block = content[512 * k : 512 * (k + 1)]
        assert block[:8] == b"UF2\n\x57\x51\x5d\x9e"
        assert block[508:] == b"\x30\x6f\xb1\x0a"
        flags, address, size, number, count, own = struct.unpack_from("<6I", block, 8)
        assert (flags, own) == ((0, 0) if family is None else (0x2000, family))
        assert (size, number, count) == (256, k, len(content) // 512)
        assert block[32 + size : 508] == b"\xff" * (476 - size)
        found |= memory(block[32 : 32 + size], address)
    return found


@pytest.mark.parametrize("address", [0, 0x0803F000, 0x1FF00, 0xFFFFFC00])
@pytest.mark.parametrize("name", ["direct-checked", "direct-left-justified-piecewise"])
def test_every_byte_stands_at_its_address(name: str, address: int, tmp_path: Path) -> None:
    bincopy = pytest.importorskip("bincopy")
    content = file_of(GOLDEN[name])
    wanted = memory(content, address)
    for ending, read in (("hex", read_hex), ("srec", read_srec)):
        text = flash_file(f"x.{ending}", Placed(content, address))
        assert read(text.decode("ascii")) == wanted
        path = tmp_path / f"x.{ending}"
        path.write_bytes(text)
        again = bincopy.BinFile(str(path))
        assert bytes(again.as_binary()) == content
        assert again.minimum_address == address


@pytest.mark.parametrize("family", [None, 0xE48BFF56])
@pytest.mark.parametrize("length", [1, 255, 256, 257, 1024])
def test_uf2_blocks_are_whole(length: int, family: int | None) -> None:
    content = Random(length).randbytes(length)
    found = read_uf2(flash_file("x.UF2", Placed(content, 0x10010000, None, family)), family)
    padded = content + b"\xff" * (-length % 256)
    assert found == memory(padded, 0x10010000)


def test_a_bin_is_filled_with_erased_flash() -> None:
    content = file_of(PLAN)
    assert flash_file("x.bin", Placed(content, None, 1024)) == content.ljust(1024, b"\xff")
    assert flash_file("x.bin", Placed(content, 0x100, len(content))) == content


REFUSED: dict[str, tuple[str, Placed, str]] = {
    "no ending": ("flash", Placed(bytes(8), 0), "no ending; expected one of hex, srec, bin, uf2"),
    "other ending": ("a.elf", Placed(bytes(8), 0), "the ending 'elf'; expected one of hex"),
    "not aligned": (
        "a.hex",
        Placed(bytes(8), 0x0803F001),
        "address: found 0x803F001; expected a multiple of 4; take 0x803F004",
    ),
    "page of UF2": (
        "a.uf2",
        Placed(bytes(8), 0x0803F004),
        "expected a multiple of 256 in a UF2 file; take 0x803F100",
    ),
    "no address": ("a.uf2", Placed(bytes(8)), "address: not stated"),
    "beyond 32 bits": (
        "a.hex",
        Placed(bytes(8), 2**32 - 4),
        "address: 0xFFFFFFFC and 8 bytes; expected an end within 32 bits",
    ),
    "reserve beyond 32 bits": (
        "a.hex",
        Placed(bytes(8), 2**32 - 64, 128),
        "0xFFFFFFC0 and 128 bytes; expected an end within 32 bits",
    ),
    "a 33-bit address": ("a.hex", Placed(bytes(8), 2**32), "address: found 4294967296; expected"),
    "negative": ("a.srec", Placed(bytes(8), -4), "address: found -4; expected a whole number"),
    "too small": (
        "a.srec",
        Placed(bytes(600), 0, 599),
        "size: found 599 bytes; expected at least 600, which the file takes",
    ),
    "blocks do not fit": ("a.uf2", Placed(bytes(300), 0, 400), "expected at least 512"),
    "padded to what": ("a.bin", Placed(bytes(8), 0), "size: not stated"),
    "family of a HEX": ("a.hex", Placed(bytes(8), 0, None, 1), "expected a file that ends in .uf2"),
    "no family": ("a.uf2", Placed(bytes(8), 0, None, 2**32), "family: found 4294967296"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused(case: str) -> None:
    name, placed, told = REFUSED[case]
    with pytest.raises(triaxcal.RefusedError) as refusal:
        flash_file(name, placed)
    assert told in str(refusal.value)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bincopy", None)
    with pytest.raises(triaxcal.RefusedError) as refusal:
        flash_file("a.hex", Placed(bytes(8), 0))
    wanted = "HEX and SREC: missing package: bincopy; install it: "
    assert str(refusal.value) == wanted + install_command("production")
    assert read_uf2(flash_file("a.uf2", Placed(bytes(8), 0)), None)  # needs no package


# ---- whose it is ----


def gyro_of(plan: Plan) -> Plan:
    return replace(plan, shape=replace(plan.shape, gyro=True))


CONTENTS: dict[str, Callable[[], bytes]] = {
    "with its identity": lambda: file_of(PLAN),
    "of 0.1.0": lambda: image_bytes(PLAN),
    "of an IMU": lambda: file_of(PLAN) + file_of(gyro_of(PLAN)),
    "of an IMU of 0.1.0": lambda: image_bytes(PLAN) + image_bytes(gyro_of(PLAN)),
    "with quadratic terms": lambda: file_of(GOLDEN["direct-quadratic"]),
}


@pytest.mark.parametrize("padding", [0, 1, 333])
@pytest.mark.parametrize("name", CONTENTS)
def test_a_file_says_whose_it_is(name: str, padding: int, tmp_path: Path) -> None:
    content = CONTENTS[name]()
    path = tmp_path / "triax.bin"
    path.write_bytes(content + b"\xff" * padding)
    found = triaxcal.read_image(path)
    assert found.content == content
    plans = [GOLDEN["direct-quadratic"]] if "quadratic" in name else [PLAN]
    plans += [gyro_of(PLAN)] if "IMU" in name else []
    assert [part.shape for part in found.parts] == [shape_id(plan) for plan in plans]
    assert [part.triad for part in found.parts] == ["accelerometer", "gyro"][: len(plans)]
    for part, plan in zip(found.parts, plans, strict=True):
        assert part.temp_codes == (plan.temp_min_code, plan.temp_max_code)
        assert (part.identity is None) == name.endswith("0.1.0")
        if part.identity is not None:
            assert part.identity.serial == "SN-0042"
    assert sum(part.size for part in found.parts) == len(content)
    assert found.summary.count("serial number") == (not name.endswith("0.1.0"))
    assert (f"and {padding} of erased flash" in found.summary) == bool(padding)


def test_the_command_shows_and_writes(tmp_path: Path) -> None:
    path = tmp_path / "triax_calib.bin"
    path.write_bytes(file_of(PLAN))
    shown = CliRunner().invoke(main, ["image", str(path)])
    assert shown.output == (
        f"triax_calib.bin: {len(file_of(PLAN))} bytes; every CRC is correct\n"
        "  serial number   SN-0042\n"
        "  measured        2026-03-30\n"
        f"  inputs sha256   {'0123456789abcdef' * 4}\n"
        f"  generator       triaxcal {triaxcal.__version__}\n"
        "  axes            -ACC2, ACC1, ACC3\n"
        "  temperature     0.0625 degC per code, -3.5 degC at code 0\n"
        f"  constants       accelerometer, shape {shape_id(PLAN)}, "
        f"{len(image_bytes(PLAN))} bytes from byte 0\n"
        "  range           -323.5 to 556.5 degC, codes -5120 to 8960\n"
    )
    target = tmp_path / "x.uf2"
    options = ["--to", str(target), "--address", "0x10010000", "--family", "1", "--size", "4096"]
    written = CliRunner().invoke(main, ["image", str(path), *options])
    assert " ".join(written.output.split()).endswith("x.uf2 written")
    found = read_uf2(target.read_bytes(), 1)
    assert bytes(found[0x10010000 + k] for k in range(len(file_of(PLAN)))) == file_of(PLAN)
    for options, told in (
        (["--address", "4"], "belong to --to"),
        (["--to", "x.hex", "--address", "4x"], "'4x' is no whole number, as 4096 or 0x1000"),
    ):
        wrong = CliRunner().invoke(main, ["image", str(path), *options])
        assert (wrong.exit_code, told in wrong.output) == (2, True)


def test_what_is_no_image_is_refused(tmp_path: Path) -> None:
    whole, bare = file_of(PLAN), image_bytes(PLAN)
    other = file_of(gyro_of(PLAN))
    for content, told in (
        (b"", "byte 0: found nothing; expected TRXC or TRXG and the version 1 or 2"),
        (b"\x7fELF\x01\x01\x01\x00", "byte 0: found 7f 45 4c 46 01 01 01 00"),
        (bare[:4] + b"\x03" + bare[5:], "byte 0: found 54 52 58 43 03 00 00 00"),
        (whole[:-1], f"{len(whole) - 1} bytes; expected"),
        (whole + b"\x00", f"byte {len(whole)}: found 00; expected TRXC"),
        (whole + other[:-5], f"{len(other) - 5} bytes; expected"),
        (whole[:-9] + bytes([whole[-9] ^ 1]) + whole[-8:], "the CRC of the identity is wrong"),
        (bare[:50] + bytes([bare[50] ^ 1]) + bare[51:], "the CRC of the constants is wrong"),
    ):
        path = tmp_path / "x.bin"
        path.write_bytes(content)
        with pytest.raises(triaxcal.RefusedError) as refusal:
            triaxcal.read_image(path)
        assert told in str(refusal.value)
        assert str(refusal.value).startswith(str(path))
    with pytest.raises(triaxcal.RefusedError, match=r"cannot be read: .*expected a triax_calib"):
        triaxcal.read_image(tmp_path / "none.bin")


@pytest.mark.parametrize("name", CONTENTS)
def test_a_file_that_is_cut_anywhere_is_refused_or_is_its_first_image(
    name: str, tmp_path: Path
) -> None:
    content = CONTENTS[name]()
    ends = set()
    for end in range(len(content)):
        path = tmp_path / "x.bin"
        path.write_bytes(content[:end])
        try:
            ends.add(sum(part.size for part in triaxcal.read_image(path).parts) == end)
        except triaxcal.RefusedError:
            continue
    assert ends <= {True}

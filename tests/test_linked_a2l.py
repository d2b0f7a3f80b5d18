"""The A2L of a linked program: addresses, values behind them, identity; and what is refused."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import triaxcal
from triaxcal.base.extras import install_command
from triaxcal.cli.main import main
from triaxcal.codegen.elf import Linked, linked_constants
from triaxcal.codegen.image import constant_words
from triaxcal.codegen.names import names_of
from triaxcal.delivery.firmware import Firmware, make_firmware
from triaxcal.delivery.saved import calibration_json
from triaxcal.delivery.unit import Delivery
from triaxcal.report.a2l import XcpOnCan, calib_a2l
from triaxcal.report.a2l_words import calib_words

pytest.importorskip("elftools")

MAIN = """
#include "triax_calib.h"
#ifdef WITH_EPK
const char epk[] = TRIAX_CALIB_EPK;
const char *volatile kept = epk;
#endif
int main(void)
{
    triax_state_t state;
    return (int)triax_set_temperature(&state, &TRIAX_CALIB, 2560);
}
"""
NO_LIBRARY = ["-nostdlib", "-ffreestanding", "-Wl,-e,main"]
TARGETS = {
    "host": ["gcc"],
    "host, whole program": ["gcc", "-O2", "-flto"],
    "Cortex-M3": ["arm-none-eabi-gcc", "-mcpu=cortex-m3", "-mthumb", *NO_LIBRARY,
                  "-Wl,-Ttext=0x08004000", "-lgcc"],
    "s390x": ["s390x-linux-gnu-gcc", "-static", *NO_LIBRARY],
    "AVR": ["avr-gcc", "-mmcu=atmega2560", "-Os"],
}  # fmt: skip


def build(firmware: Firmware, folder: Path, compiler: list[str], *flags: str) -> Path:
    """A program of all C of a unit."""
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"{compiler[0]} is not installed")
    folder.mkdir(exist_ok=True)
    for name, content in firmware.files.items():
        (folder / name).write_bytes(content)
    (folder / "main.c").write_text(MAIN, encoding="ascii")
    prefix = firmware.plan.prefix
    sources = ["main.c", f"{prefix}_comp.c", f"{prefix}_calib.c"]
    command = [compiler[0], *sources, *compiler[1:], *flags, "-o", "fw.elf"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "fw.elf"


def loaded(elf: bytes, address: int, size: int) -> bytes:
    """Bytes at a virtual address: the ELF header and the program headers, read here by hand."""
    wide, order = elf[4] == 2, "<" if elf[5] == 1 else ">"
    at = struct.unpack_from(order + ("Q" if wide else "I"), elf, 32 if wide else 28)[0]
    each, count = struct.unpack_from(order + "HH", elf, 54 if wide else 42)
    for k in range(at, at + each * count, each):
        if wide:
            kind, _, offset, start, _, length = struct.unpack_from(order + "IIQQQQ", elf, k)
        else:
            kind, offset, start, _, length = struct.unpack_from(order + "IIIII", elf, k)
        if kind == 1 and start <= address < start + length:
            return elf[offset + address - start :][:size]
    raise AssertionError(f"nothing is loaded at 0x{address:X}")


@pytest.fixture(scope="module")
def made(delivered: dict[str, Delivery]) -> Firmware:
    return delivered["AT-SIM"].firmware


def addresses(text: str) -> dict[str, int]:
    """Of each CHARACTERISTIC, by its name."""
    found = re.findall(r'/begin CHARACTERISTIC (\w+) "[^"]*"\s+VALUE (\w+) ', text)
    return {name: int(address, 0) for name, address in found}


@pytest.mark.parametrize("target", TARGETS)
def test_the_values_behind_the_addresses_are_those_of_the_plan(
    made: Firmware, tmp_path: Path, target: str
) -> None:
    elf = build(made, tmp_path, TARGETS[target], "-DWITH_EPK")
    linked = linked_constants(elf, made.plan, made.provenance)
    text = calib_a2l(made, linked).decode("ascii")
    content = elf.read_bytes()
    big = target == "s390x"
    assert f"BYTE_ORDER {'MSB_FIRST' if big else 'MSB_LAST'}" in text
    found = addresses(text)
    words = {w.name: w for w in calib_words(made)}
    assert set(found) == set(words)

    def physical(name: str) -> float:
        integer = struct.unpack(">i" if big else "<i", loaded(content, found[name], 4))[0]
        return words[name].method.slope * integer + words[name].method.intercept

    sensor, plan = made.fitted.unit.temperature_sensor, made.plan
    assert physical("TRIAX_temp_min") == sensor.degc(plan.temp_min_code)
    assert physical("TRIAX_temp_max") == sensor.degc(plan.temp_max_code)
    # N at the origin of the segment is what the compensation evaluates there, in g/V.
    origin = physical("TRIAX_s0_origin")
    for axis, row in enumerate("xyz"):
        unit_v = np.zeros((2, 3))
        unit_v[1, axis] = 1.0
        forces = made.compensation.evaluate(unit_v, np.full(2, origin))
        name = next(n for n in words if n.endswith(f"_N{row}{row}_0"))
        # Half a slope is the rounding of the word, a part in 10^12 that of the floats.
        difference = physical(name) - (forces[1] - forces[0])[axis]
        assert abs(difference) <= 0.5 * words[name].method.slope + 1e-12
    # AVR's linker adds 0x800000 to addresses of data, of which the text is a part.
    epk = re.search(r"ADDR_EPK (\w+)", text)
    assert epk is not None
    wanted = made.provenance.epk.encode()
    assert loaded(content, int(epk[1], 0), len(wanted)) == wanted
    assert f'EPK "{wanted.decode()}"' in text


def test_without_the_text_there_is_no_address_of_the_epk(made: Firmware, tmp_path: Path) -> None:
    elf = build(made, tmp_path, TARGETS["host"])
    linked = linked_constants(elf, made.plan, made.provenance)
    assert linked.epk_address is None
    text = calib_a2l(made, linked).decode()
    assert "ADDR_EPK" not in text
    assert f'EPK "{made.provenance.epk}"' in text
    assert "DATA FLASH INTERN" in text


LOADS = """
#include "triax_comp.h"
triax_calib_t calib;
static triax_calib_t other;
int twice;
int main(void)
{
    static const uint8_t image[TRIAX_FILE_SIZE];
    triax_calib_load(&other, image, 1);
    return (int)triax_calib_load(&calib, image, TRIAX_FILE_SIZE);
}
"""


def test_a_variable_that_is_loaded_from_an_image(made: Firmware, tmp_path: Path) -> None:
    for name, content in made.files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "main.c").write_text(LOADS, encoding="ascii")
    (tmp_path / "more.c").write_text("static int other[3]; int *kept = other;\n", encoding="ascii")
    command = ["gcc", "main.c", "more.c", "triax_comp.c", "-o", "fw.elf"]
    subprocess.run(command, cwd=tmp_path, check=True)
    elf = tmp_path / "fw.elf"
    linked = linked_constants(elf, made.plan, made.provenance, "calib")
    listed = subprocess.run(["nm", elf], capture_output=True, text=True, check=True).stdout
    found = re.search(r"^(\w+) \w calib$", listed, re.MULTILINE)
    assert found is not None
    assert (linked.address, linked.writable) == (int(found[1], 16), True)
    assert linked.size == 4 * len(constant_words(made.plan))
    text = calib_a2l(made, linked).decode()
    assert addresses(text)["TRIAX_temp_max"] == linked.address + 4
    assert 'SYMBOL_LINK "calib" 4\n' in text
    assert "DATA RAM INTERN" in text
    for variable, told in (
        ("none", f"{elf}: no variable none; expected one triax_calib_t of this name; give its"),
        ("other", f"{elf}: 2 variables other; expected one triax_calib_t of this name; give it a"),
        ("twice", f"{elf}: twice has 4 bytes; expected the 212 bytes of triax_calib_t of this"),
    ):
        with pytest.raises(triaxcal.RefusedError) as refusal:
            linked_constants(elf, made.plan, made.provenance, variable)
        assert str(refusal.value).startswith(told)
    # The size is the same, the conversions are not.
    other_q = replace(made.plan, shape=replace(made.plan.shape, output_q=23))
    with pytest.raises(triaxcal.RefusedError) as refusal:
        linked_constants(elf, other_q, made.provenance, "calib")
    shapes = [names_of(plan).shape for plan in (made.plan, other_q)]
    assert f"the routine triax has the shape {shapes[0]}; expected the shape {shapes[1]}" in (
        str(refusal.value)
    )
    with pytest.raises(triaxcal.RefusedError, match="routine left has no name with a shape"):
        linked_constants(elf, replace(made.plan, prefix="left"), made.provenance, "calib")


@pytest.mark.parametrize("extended", [False, True])
def test_another_parser_reads_segment_epk_and_xcp(
    made: Firmware, tmp_path: Path, extended: bool
) -> None:
    pya2l = pytest.importorskip("pya2l")
    from pya2l import model
    from pya2l.aml.ifdata_parser import IfDataParser

    linked = Linked("calib", 0x0800048C, 260, not extended, extended, 0x0800046C)
    ids = (0x98FF0001, 0x98FF0002) if extended else (0x555, 0x666)
    path = tmp_path / "fw.a2l"
    path.write_bytes(calib_a2l(made, linked, XcpOnCan(*ids, None if extended else 500_000)))
    session = pya2l.import_a2l(str(path), in_memory=True, loglevel="ERROR")
    segment = session.query(model.MemorySegment).one()
    assert (segment.address, segment.size, segment.prgType) == (0x0800048C, 260, "DATA")
    assert segment.memoryType == ("RAM" if extended else "FLASH")
    assert session.query(model.Epk).one().identifier == made.provenance.epk
    assert session.query(model.AddrEpk).one().address == 0x0800046C
    order = "MSB_FIRST" if extended else "MSB_LAST"
    assert session.query(model.ByteOrder).one().byteOrder == order
    found = {c.name: c.address for c in session.query(model.Characteristic).all()}
    assert found == {w.name: 0x0800048C + w.offset for w in calib_words(made)}
    (data,) = session.query(model.IfData).all()
    layers = IfDataParser(session).parse(data.raw)["XCP"]
    protocol = layers[0]["PROTOCOL_LAYER"]
    assert protocol[8:12] == [8, 8, f"BYTE_ORDER_{order}", "ADDRESS_GRANULARITY_BYTE"]
    bus = layers[1]["XCP_ON_CAN"][0][1]
    assert [bus["CAN_ID_MASTER"], bus["CAN_ID_SLAVE"]] == list(ids)
    assert bus.get("BAUDRATE") == (None if extended else 500_000)


@pytest.mark.parametrize(
    ("xcp", "told"),
    [
        (
            XcpOnCan(0x18FF0001, 1),
            (
                "CAN identifier: found 0x18ff0001; expected 0 to 0x7ff, or a 29-bit id with bit 31 "
                "set: 0x98ff0001"
            ),
        ),
        (XcpOnCan(2**29, 1), "CAN identifier: found 0x20000000; expected 0 to 0x7ff, or a 29-bit"),
        (XcpOnCan(2**31 + 2**29, 1), "CAN identifier: found 0xa0000000"),
        (XcpOnCan(1, -1), "CAN identifier: found -0x1"),
        (XcpOnCan(0x555, 0x555), "CAN identifiers: 0x555 twice; expected two identifiers"),
        (XcpOnCan(1, 2, 500), "bitrate: found 500 bit/s; expected 1000 to 1000000"),
    ],
)
def test_what_no_can_bus_has_is_refused(made: Firmware, xcp: XcpOnCan, told: str) -> None:
    with pytest.raises(triaxcal.RefusedError) as refusal:
        calib_a2l(made, None, xcp)
    assert told in str(refusal.value)


def test_a_prefix_stands_in_every_name(made: Firmware) -> None:
    """Two sensors in one project of a tool: no name of one is a name of the other."""
    left = with_plan(made, prefix="left_accel")
    names = [
        set(re.findall(r"/begin \w+ ([A-Za-z]\w*) ", calib_a2l(f).decode())) for f in (made, left)
    ]
    assert names[0] & names[1] == {"TRIAX"}  # the project
    assert "LEFT_ACCEL_temp_min" in names[1]


# ---- refusals ----


def refusal_of(elf: Path, firmware: Firmware) -> str:
    with pytest.raises(triaxcal.RefusedError) as refusal:
        linked_constants(elf, firmware.plan, firmware.provenance)
    text = str(refusal.value)
    assert text.startswith(f"{elf}: ")
    return text


def with_plan(firmware: Firmware, **changes: Any) -> Firmware:
    """The firmware with its plan changed."""
    functions = firmware.functions
    return replace(firmware, functions=replace(functions, plan=replace(functions.plan, **changes)))


def with_other_word(firmware: Firmware) -> Firmware:
    """The same shape, one coefficient other by one."""
    segment = firmware.plan.segments[0]
    coefficients = segment.coefficients.copy()
    coefficients[0, 0] += 1
    segments = (replace(segment, coefficients=coefficients), *firmware.plan.segments[1:])
    return with_plan(firmware, segments=segments)


def test_constants_of_another_unit_are_refused(made: Firmware, tmp_path: Path) -> None:
    elf = build(made, tmp_path, TARGETS["host"])
    word = int(made.plan.segments[0].coefficients[0, 0])
    assert refusal_of(elf, with_other_word(made)) == (
        f"{elf}: 1 of 53 constants are not those of the unit, the first at byte 20 ({word}); "
        f"expected {word + 1} there; link the C of this delivery, or name the unit that the "
        "program was linked for"
    )


def test_constants_of_other_inputs_are_refused_by_their_hash(
    made: Firmware, tmp_path: Path
) -> None:
    """Of one shape, whatever they are: the linker gives the program those of its header."""
    elf = build(made, tmp_path, TARGETS["host"])
    provenance = replace(made.provenance, inputs_sha256="5a" * 32)
    with pytest.raises(triaxcal.RefusedError) as refusal:
        linked_constants(elf, made.plan, provenance)
    assert str(refusal.value) == (
        f"{elf}: the constants triax are of another unit, or of earlier inputs: "
        f"{made.provenance.inputs_sha256[:8]}; expected those of the inputs 5a5a5a5a, as "
        "TRIAX_CALIB_INPUTS of this delivery; link the C of this delivery, or name the unit that "
        "the program was linked for"
    )


def test_another_shape_is_named(
    made: Firmware, delivered: dict[str, Delivery], tmp_path: Path
) -> None:
    elf = build(made, tmp_path, TARGETS["host"])
    other = delivered["AT-CHERNIAK"].firmware
    shapes = [names_of(f.plan).shape for f in (made, other)]
    assert f"the constants triax have the shape {shapes[0]}; expected the shape {shapes[1]};" in (
        refusal_of(elf, other)
    )
    left = with_plan(made, prefix="left_accel")
    unit = f"{shapes[0]}_{made.provenance.inputs_sha256[:8]}"
    assert (
        f"no symbol left_accel_{unit}_calib_constants, but triax_{unit}_calib_constants; expected "
        "a program that uses the constants of this unit; if they are this unit's, say so: "
        "--prefix triax"
    ) in refusal_of(elf, left)


def test_programs_without_the_symbol_are_refused(made: Firmware, tmp_path: Path) -> None:
    elf = build(made, tmp_path, TARGETS["host"])
    subprocess.run(["strip", "-o", "stripped.elf", elf.name], cwd=tmp_path, check=True)
    unit = f"{names_of(made.plan).linked}_{made.provenance.inputs_sha256[:8]}"
    symbol = f"{unit}_calib_constants"
    # The host's libc leaves dynamic symbols in a stripped file; firmware has none.
    assert f"no symbol {symbol}; expected" in refusal_of(tmp_path / "stripped.elf", made)
    (tmp_path / "none.c").write_text("int main(void) { return 0; }\n", encoding="ascii")
    subprocess.run(["gcc", "none.c", "-o", "none.elf"], cwd=tmp_path, check=True)
    assert (
        f"no symbol {symbol}; expected a program that uses the constants of this unit; compile "
        "triax_calib.c, and use TRIAX_CALIB: the linker drops what nobody uses"
    ) in refusal_of(tmp_path / "none.elf", made)
    subprocess.run(["gcc", "-c", "triax_calib.c"], cwd=tmp_path, check=True)
    assert "not linked (ET_REL): its addresses are not final" in (
        refusal_of(tmp_path / "triax_calib.o", made)
    )


def test_a_stripped_firmware_is_refused(made: Firmware, tmp_path: Path) -> None:
    elf = build(made, tmp_path, TARGETS["Cortex-M3"])
    subprocess.run(["arm-none-eabi-strip", elf.name], cwd=tmp_path, check=True)
    assert refusal_of(elf, made) == (
        f"{elf}: no symbols: the file is stripped; expected the program as the linker wrote it; "
        "strip a copy, and give the file before"
    )


def test_what_is_no_elf_is_refused(made: Firmware, tmp_path: Path) -> None:
    path = tmp_path / "fw.hex"
    for content, told in ((b"", "begins with nothing"), (b":020000", "begins with 3a 30 32 30")):
        path.write_bytes(content)
        text = refusal_of(path, made)
        assert told in text
        assert "expected an ELF file, as the linker writes it (.elf, .axf, .out)" in text
    assert "cannot be read: no such file" in refusal_of(tmp_path / "none.elf", made)
    assert "cannot be read: is a directory" in refusal_of(tmp_path, made)


def test_a_damaged_elf_is_refused_or_read_right(made: Firmware, tmp_path: Path) -> None:
    elf = build(made, tmp_path, TARGETS["host"])
    content = elf.read_bytes()
    right = linked_constants(elf, made.plan, made.provenance)
    rng = np.random.default_rng(14)
    cuts = [content[: int(n)] for n in rng.integers(4, len(content), 40)]
    flipped = []
    headers = int.from_bytes(content[40:48], "little")  # of the sections
    for at in (*range(4, 64), *rng.integers(headers, len(content), 60)):
        damaged = bytearray(content)
        damaged[at] ^= 1 << int(rng.integers(8))
        flipped.append(bytes(damaged))
    path = tmp_path / "damaged.elf"
    refused = 0
    for damaged_file in (*cuts, *flipped):
        path.write_bytes(damaged_file)
        try:
            found = linked_constants(path, made.plan, made.provenance)
        except triaxcal.RefusedError:
            refused += 1
        else:  # the compared bytes are the constants, wherever the damage is
            assert found.size == right.size
    assert refused >= len(cuts)


def test_a_missing_package_is_named(
    made: Firmware, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "fw.elf"
    path.write_bytes(b"\x7fELF")
    monkeypatch.setitem(sys.modules, "elftools.elf.elffile", None)
    wanted = f"{path}: missing package: pyelftools; install it: {install_command('production')}"
    assert refusal_of(path, made) == wanted


# ---- the command ----


def test_the_command_writes_beside_the_program(
    delivered: dict[str, Delivery], tmp_path: Path
) -> None:
    delivery = delivered["AT-SIM"]
    elf = build(delivery.firmware, tmp_path / "fw", TARGETS["host"])
    (tmp_path / "calibration.json").write_bytes(calibration_json(delivery))
    done = CliRunner().invoke(
        main, ["a2l", str(tmp_path), "--elf", str(elf), "--can-ids", "0x555", "1638"]
    )
    assert done.output.split() == [str(elf.parent / "triax_calib.a2l"), "written"]
    made = make_firmware(delivery)
    linked = linked_constants(elf, made.plan, made.provenance)
    wanted = calib_a2l(made, linked, XcpOnCan(0x555, 0x666))
    assert (elf.parent / "triax_calib.a2l").read_bytes() == wanted
    target = tmp_path / "other.a2l"
    CliRunner().invoke(main, ["a2l", str(tmp_path), "--elf", str(elf), "--to", str(target)])
    assert target.read_bytes() == calib_a2l(made, linked)
    alone = CliRunner().invoke(
        main, ["a2l", str(tmp_path), "--elf", str(elf), "--bitrate", "500000"]
    )
    assert "bitrate: stated; expected CAN identifiers as well" in str(alone.exception)

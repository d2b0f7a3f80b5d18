"""ARXML, KCD and SYM of a rig, and what of them is refused; payloads are packed here by hand."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from triaxcal.base.errors import RefusedError
from triaxcal.rig.bus.frames import EFF_FLAG, alike, concatenate
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.samples.samples import SampleDecoder

LITTLE, BIG = "MOST-SIGNIFICANT-BYTE-LAST", "MOST-SIGNIFICANT-BYTE-FIRST"
AXES = (("X", 0, 16, LITTLE, "s16"), ("Y", 23, 16, BIG, "s16"), ("Z", 32, 16, LITTLE, "s16"))
COUNT = ("N", 48, 8, LITTLE, "u8")
BASES = (("s16", 16, "2C"), ("u8", 8, "NONE"), ("f32", 32, "IEEE754"))
WARM_ID = 0x18FF0102


def tag(name, *inner, **attributes):
    said = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<{name}{said}>{''.join(inner)}</{name}>"


def named(kind, name, *inner):
    return tag(kind, tag("SHORT-NAME", name), *inner)


def ref(kind, target, path):
    return tag(f"{kind}-REF", path, DEST=target)


def props(*inner):
    inside = tag("SW-DATA-DEF-PROPS-CONDITIONAL", *inner)
    return tag("SW-DATA-DEF-PROPS-VARIANTS", inside)


def package(name, *elements):
    return named("AR-PACKAGE", name, tag("ELEMENTS", *elements))


def frame_parts(name, size, signals):
    """CAN-FRAME, I-SIGNAL-I-PDU, I-SIGNALs and SYSTEM-SIGNALs of one message."""
    frame = named(
        "CAN-FRAME", name, tag("FRAME-LENGTH", str(size)),
        tag("PDU-TO-FRAME-MAPPINGS", named(
            "PDU-TO-FRAME-MAPPING", f"M_{name}", tag("PACKING-BYTE-ORDER", LITTLE),
            ref("PDU", "I-SIGNAL-I-PDU", f"/Pdu/P_{name}"), tag("START-POSITION", "0"),
        )),
    )  # fmt: skip
    maps, i_signals, systems = [], [], []
    for signal, start, bits, order, base in signals:
        mine = ref("I-SIGNAL", "I-SIGNAL", f"/Sig/{signal}")
        maps.append(named(
            "I-SIGNAL-TO-I-PDU-MAPPING", f"S_{signal}", mine,
            tag("PACKING-BYTE-ORDER", order), tag("START-POSITION", str(start)),
        ))  # fmt: skip
        sent = props(ref("BASE-TYPE", "SW-BASE-TYPE", f"/Base/{base}"))
        i_signals.append(named(
            "I-SIGNAL", signal, tag("LENGTH", str(bits)), tag("NETWORK-REPRESENTATION-PROPS", sent),
            ref("SYSTEM-SIGNAL", "SYSTEM-SIGNAL", f"/Sys/{signal}"),
        ))  # fmt: skip
        unit = {"s16": "half_mg", "f32": "celsius"}.get(base, "none")
        meant = props(ref("COMPU-METHOD", "COMPU-METHOD", f"/Compu/{unit}"))
        systems.append(named("SYSTEM-SIGNAL", signal, tag("PHYSICAL-PROPS", meant)))
    pdu = named("I-SIGNAL-I-PDU", f"P_{name}", tag("LENGTH", str(size)),
                tag("I-SIGNAL-TO-PDU-MAPPINGS", *maps))  # fmt: skip
    return frame, pdu, i_signals, systems


def linear(name, factor, unit):
    scale = tag(
        "COMPU-SCALE",
        tag("COMPU-RATIONAL-COEFFS", tag("COMPU-NUMERATOR", tag("V", "0"), tag("V", factor)),
            tag("COMPU-DENOMINATOR", tag("V", "1"))),
    )  # fmt: skip
    return named("COMPU-METHOD", name, tag("CATEGORY", "LINEAR"),
                 ref("UNIT", "UNIT", f"/Unit/{unit}"),
                 tag("COMPU-INTERNAL-TO-PHYS", tag("COMPU-SCALES", scale)))  # fmt: skip


def triggering(name, addressing, number):
    return named(
        "CAN-FRAME-TRIGGERING", f"T_{name}", ref("FRAME", "CAN-FRAME", f"/Frame/{name}"),
        tag("CAN-ADDRESSING-MODE", addressing), tag("IDENTIFIER", str(number)),
    )  # fmt: skip


def arxml(encoding="UTF-8"):
    """A sensor with axes of either byte order, and a thermometer of 29 bits that sends a float."""
    imu, imu_pdu, imu_signals, imu_systems = frame_parts("IMU", 8, (*AXES, COUNT))
    warm, warm_pdu, warm_signals, warm_systems = frame_parts(
        "WARM", 4, [("T", 0, 32, LITTLE, "f32")]
    )
    channel = named(
        "CAN-PHYSICAL-CHANNEL", "Channel",
        tag("FRAME-TRIGGERINGS", triggering("IMU", "STANDARD", 0x123),
            triggering("WARM", "EXTENDED", WARM_ID)),
    )  # fmt: skip
    cluster = named("CAN-CLUSTER", "Bus", tag("CAN-CLUSTER-VARIANTS", tag(
        "CAN-CLUSTER-CONDITIONAL", tag("BAUDRATE", "500000"), tag("PHYSICAL-CHANNELS", channel),
    )))  # fmt: skip
    bases = [
        named("SW-BASE-TYPE", name, tag("CATEGORY", "FIXED_LENGTH"),
              tag("BASE-TYPE-SIZE", str(bits)), tag("BASE-TYPE-ENCODING", kind))
        for name, bits, kind in BASES
    ]  # fmt: skip
    units = [named("UNIT", n, tag("DISPLAY-NAME", text))
             for n, text in (("mg", "mg"), ("degc", "°C"), ("none", ""))]  # fmt: skip
    packages = (
        package("Bus", cluster), package("Frame", imu, warm), package("Pdu", imu_pdu, warm_pdu),
        package("Sig", *imu_signals, *warm_signals), package("Sys", *imu_systems, *warm_systems),
        package("Compu", linear("half_mg", "0.5", "mg"), linear("celsius", "1", "degc"),
                linear("none", "1", "none")),
        package("Unit", *units), package("Base", *bases),
    )  # fmt: skip
    schema = "http://autosar.org/schema/r4.0"
    head = f'<?xml version="1.0" encoding="{encoding}"?>'
    space = (f'<AUTOSAR xmlns="{schema}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
             f'xsi:schemaLocation="{schema} AUTOSAR_4-2-2.xsd">')  # fmt: skip
    return f"{head}{space}{tag('AR-PACKAGES', *packages)}</AUTOSAR>"


KCD = """<?xml version="1.0" encoding="UTF-8"?>
<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document name="t"/><Bus name="A">
<Message id="0x123" length="8" name="IMU">
<Signal name="X" offset="0" length="16"><Value type="signed" slope="0.5" unit="mg"/></Signal>
<Signal name="Y" offset="16" length="16" endianess="big">
<Value type="signed" slope="0.5" unit="mg"/></Signal>
<Signal name="Z" offset="32" length="16"><Value type="signed" slope="0.5" unit="mg"/></Signal>
<Signal name="N" offset="48" length="8"/></Message>
<Message id="0x18FF0102" length="4" name="WARM" format="extended">
<Signal name="T" offset="0" length="32"><Value type="single" unit="°C"/></Signal></Message>
</Bus></NetworkDefinition>
"""
SYM = """FormatVersion=6.0 // Do not edit this line!
Title="t"
{SIGNALS}
Sig=X signed 16 /u:mg /f:0.5
Sig=Y signed 16 -m /u:mg /f:0.5
Sig=Z signed 16 /u:mg /f:0.5
Sig=N unsigned 8
Sig=T float 32 /u:"°C"
{SENDRECEIVE}
[IMU]
ID=123h
Type=Standard
Len=8
Sig=X 0
Sig=Y 16
Sig=Z 32
Sig=N 48
[WARM]
ID=18FF0102h
Type=Extended
Len=4
Sig=T 0
"""
KEYS = """format = 1
[rig]
file = "{file}"
[signals]
x = "IMU.X"
y = "IMU.Y"
z = "IMU.Z"
temperature = "WARM.T"
[message.IMU]
counter = "N"
"""
FILES = {
    "utf-8.arxml": arxml().encode(),
    "latin.arxml": arxml("ISO-8859-1").encode("latin-1"),
    "utf-16.arxml": arxml("UTF-16").encode("utf-16"),
    "rig.kcd": KCD.encode(),
    "rig.sym": SYM.encode("cp1252"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_rig_of_every_kind_of_bus_description(tmp_path, name):
    (tmp_path / name).write_bytes(FILES[name])
    (tmp_path / "rig.toml").write_text(KEYS.format(file=name), encoding="utf-8")
    rig = read_description(tmp_path / "rig.toml")
    axes = np.random.default_rng(1).integers(-(2**15), 2**15, (300, 3))
    t_ns = 10**18 + np.arange(300) * 10_000_000
    rows = [
        struct.pack("<h", x) + struct.pack(">h", y) + struct.pack("<hBx", z, k % 256)
        for k, (x, y, z) in enumerate(axes.tolist())
    ]
    temps = [20.0 + k / 7 for k in range(300)]
    words = [struct.pack("<f4x", temp) for temp in temps]
    data = [np.frombuffer(b"".join(part), np.uint8).reshape(-1, 8) for part in (rows, words)]
    frames = concatenate(
        [
            alike(t_ns, 0x123, 8, False, data[0]),
            alike(t_ns + 1000, WARM_ID | EFF_FLAG, 4, False, data[1]),
        ]
    )
    samples = SampleDecoder(rig, 100).feed(frames.take(np.argsort(frames.t_ns, kind="stable")))
    assert samples.codes.tolist() == axes.tolist()
    assert samples.temp_code.tolist() == [struct.unpack("<f", w[:4])[0] for w in words]
    assert not len(samples.trouble)
    assert [axis.g for axis in rig.axes] == [(0.0005, 0.0)] * 3
    assert rig.temperature.degc == (1.0, 0.0)


def test_a_j1939_message_of_several_frames_is_refused(tmp_path):
    (tmp_path / "long.dbc").write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: N\nBO_ 2566845056 IMU: 12 N\n'
        + "".join(f' SG_ {a} : {32 * i}|32@1- (1,0) [0|0] "mg" N\n' for i, a in enumerate("XYZ"))
        + 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2566845056 3;\n',
        encoding="utf-8",
    )
    signals = 'x = "IMU.X"\ny = "IMU.Y"\nz = "IMU.Z"\n'
    path = tmp_path / "rig.toml"
    path.write_text(f'format = 1\n[rig]\nfile = "long.dbc"\n[signals]\n{signals}')
    with pytest.raises(RefusedError) as refused:
        read_description(path)
    assert str(refused.value) == (
        f"{path}, [message.IMU]: 12 bytes, which J1939 sends in several frames; expected a message "
        "of at most 8 bytes: transport protocol is not read; name signals of another message, or "
        "let the unit send them in one frame"
    )

"""rig.toml: what it may say of a bus description, and what is refused by name."""

from __future__ import annotations

from dataclasses import replace

import pytest
from any_rig_cases import KINDS, any_setup

from triaxcal.base.errors import RefusedError
from triaxcal.rig.description.rigfile import read_description
from triaxcal.rig.description.shippedrigs import find_description, shipped_descriptions
from triaxcal.rig.plan.plan import read_plan
from triaxcal.rig.samples.undetected import undetected
from triaxcal.unit.adc import whole_adc
from triaxcal.unit.description import read_unit

DBC = """VERSION ""
NS_ :
BS_:
BU_: E
BO_ 256 IMU: 8 E
 SG_ AccX : 0|16@1- (0.001,0) [0|0] "g" E
 SG_ AccY : 16|16@1- (0.001,0) [0|0] "g" E
 SG_ AccZ : 32|16@1- (0.002,0) [0|0] "g" E
 SG_ Count : 48|4@1+ (1,0) [0|0] "" E
 SG_ State : 52|4@1+ (1,0) [0|0] "" E
 SG_ Crc : 56|8@1+ (1,0) [0|0] "" E
BO_ 257 ENV: 8 E
 SG_ Temp : 0|16@1- (0.01,20) [0|0] "degC" E
 SG_ Yaw : 16|16@1- (0.01,0) [0|0] "deg/s" E
 SG_ Plain : 32|16@1- (1,0) [0|0] "" E
BO_ 258 MUX: 8 E
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" E
 SG_ Serial m0 : 8|32@1+ (1,0) [0|0] "" E
 SG_ AccZ m1 : 8|16@1- (0.001,0) [0|0] "g" E
BO_ 259 BAD: 2 E
 SG_ Code : 0|8@1- (0.5,100) [0|0] "code" E
BO_ 2566834178 J1: 8 E
 SG_ A : 0|16@1- (1,0) [0|0] "g" E
BO_ 2633943042 J2: 8 E
 SG_ B : 0|16@1- (1,0) [0|0] "g" E
"""
SIGNALS = """x = "IMU.AccX"
y = "IMU.AccY"
z = "IMU.AccZ"
temperature = "ENV.Temp"
"""


def written(folder, signals=SIGNALS, messages="", dbc=DBC):
    (folder / "imu.dbc").write_text(dbc)
    path = folder / "rig.toml"
    path.write_text(f'format = 1\n[rig]\nfile = "imu.dbc"\n[signals]\n{signals}{messages}')
    return path


def test_the_shortest_description(tmp_path):
    rig = read_description(written(tmp_path))
    assert [axis.label for axis in rig.axes] == ["IMU.AccX", "IMU.AccY", "IMU.AccZ"]
    assert list(rig.messages) == ["IMU", "ENV"]
    assert (rig.join, rig.sample_at, rig.fd) == ("", "IMU", False)
    assert [axis.g for axis in rig.axes] == [(0.001, -0.0), (0.001, -0.0), (0.002, -0.0)]
    assert rig.temperature.degc == (0.01, 20.0)


def change(old, new):
    return SIGNALS.replace(old, new)


@pytest.mark.parametrize(
    ("signals", "messages", "said"),
    [
        (change("IMU.AccX", "IMU.Accx"), "", "[signals] x: no signal 'IMU.Accx'; nearest: IMU.A"),
        (change("IMU.AccY", "IMU.AccX"), "", "[signals] y: IMU.AccX is x already"),
        (change("ENV.Temp", "ENV.Yaw"), "", "ENV.Yaw: its unit is 'deg/s'; expected code, or"),
        (change("IMU.AccX", "ENV.Yaw"), "", "ENV.Yaw: its unit is 'deg/s'"),
        (change("IMU.AccX", "BAD.Code"), "", "BAD.Code: the bus description makes 0.5 * raw + 100"),
        (change("IMU.AccZ", "MUX.AccZ"), "", "[signals] join: missing; the axes come in 2 frames"),
        (
            change("IMU.AccZ", "MUX.AccZ") + 'join = "counter"\n', "",
            '"counter", and [message.IMU] has none',
        ),
        (change("IMU.AccZ", "MUX.AccZ") + 'join = "age"\n', "", "[signals] age_s: missing"),
        (
            change("IMU.AccZ", "MUX.AccZ") + 'join = "age"\nage_s = 0.01\nsample_at = "ENV"\n', "",
            "[signals] sample_at: found 'ENV'; expected one of IMU, MUX",
        ),
        (SIGNALS + 'sample_time = "ENV.Plain"\n', "", "ENV.Plain is no clock"),
        (SIGNALS + 'sample_time = "IMU.Count"\n', "", "state sample_tick_us"),
        (SIGNALS + 'record = "maybe"\n', "", 'found \'maybe\'; expected one of "raw", "value"'),
        (SIGNALS, "[message.IMUS]\n", "[message.IMUS]: no message 'IMUS'; nearest: IMU"),
        (
            SIGNALS, '[message.IMU]\ncounter = "Cnt"\n',
            "[message.IMU] counter: no signal 'Cnt'; nearest: Count",
        ),
        (
            SIGNALS, '[message.MUX]\nstatus = "Page"\n',
            "no key of [signals] names a signal of this message",
        ),
        (
            SIGNALS + 'serial = "MUX.Serial"\n', '[message.MUX]\ncounter = "Serial"\n',
            "Serial is multiplexed",
        ),
        (SIGNALS, '[message.IMU]\ncrc = "Crc"\n', "[message.IMU] protection: missing"),
        (
            SIGNALS, '[message.IMU]\ncrc = "State"\nprotection = "sae-j1850"\n',
            "State has 4 bits from bit 52; expected 8 bits in whole bytes",
        ),
        (
            SIGNALS, '[message.IMU]\ncrc = "Crc"\nprotection = "saej1850"\n',
            'did you mean "sae-j1850"?',
        ),
        (
            SIGNALS, '[message.IMU]\ncrc = "Crc"\nprotection = "e2e-p01"\n',
            "data_id: 0 numbers; expected 1 for AUTOSAR E2E profile 1",
        ),
        (
            SIGNALS, '[message.IMU]\ncounter = "Count"\ncounter_modulus = 17\n',
            "counter_modulus: found 17; expected at most 16",
        ),
        (SIGNALS, "[message.IMU]\nj1939 = true\n", "ID 0x100 of 11 bits"),
        (SIGNALS, "[message.IMU]\nsource_address = 3\n", "given for an ID that is not J1939's"),
        (
            change("IMU.AccX", "J1.A").replace("IMU.AccY", "J2.B") + 'join = "age"\nage_s = 0.01\n',
            "[message.J1]\nj1939 = true\n[message.J2]\nj1939 = true\n",
            "its frames cannot be told from those of J1",
        ),
        (
            SIGNALS, '[message.IMU]\ncounter = "State"\nstatus = "State"\n',
            "[message.IMU] status: IMU.State is [message.IMU] counter already",
        ),
        (SIGNALS, '[message.IMU]\ncounter = "AccY"\n', "counter: IMU.AccY is [signals] y"),
        (SIGNALS + 'serial = "ENV.Plain"\nrate = "ENV.Plain"\n', "", "rate: ENV.Plain is [sig"),
        (
            change('"IMU.AccY"', '["IMU.AccY", "IMU.AccX"]'), "",
            'expected one signal, "Message.Signal"; an axis that is described as several signals',
        ),
        (change("IMU.AccX", "J1.A") + "y2 = 1\n", "", "unknown: [signals] y2"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_name(tmp_path, signals, messages, said):
    with pytest.raises(RefusedError) as refusal:
        read_description(written(tmp_path, signals, messages))
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert "rig.toml" in str(refusal.value)


def test_signals_that_lie_on_each_other_are_refused(tmp_path):
    dbc = DBC.replace("AccY : 16|16", "AccY : 8|16")
    with pytest.raises(RefusedError, match=r"IMU\.AccY: shares bits with AccX"):
        read_description(written(tmp_path, dbc=dbc))


def test_a_signal_beyond_its_message_is_refused(tmp_path):
    dbc = DBC.replace("BO_ 257 ENV: 8", "BO_ 257 ENV: 1")
    with pytest.raises(RefusedError, match=r"ENV\.Temp needs 2 bytes, and the message has 1"):
        read_description(written(tmp_path, dbc=dbc))


def test_a_counter_may_be_the_time_of_the_sample(tmp_path):
    signals = SIGNALS + 'sample_time = "IMU.Count"\nsample_tick_us = 10000\n'
    rig = read_description(written(tmp_path, signals, '[message.IMU]\ncounter = "Count"\n'))
    assert rig.sample_time.turn == rig.messages["IMU"].counter_modulus == 16


@pytest.mark.parametrize(
    ("old", "new", "label"),
    [
        ('AccY : 16|16@1- (0.001', 'AccY : 16|16@1- (0', "y: IMU.AccY"),
        ("Temp : 0|16@1- (0.01", "Temp : 0|16@1- (0.0", "temperature: ENV.Temp"),
    ],
)  # fmt: skip
def test_a_factor_of_0_is_refused(tmp_path, old, new, label):
    with pytest.raises(RefusedError) as refusal:
        read_description(written(tmp_path, dbc=DBC.replace(old, new)))
    assert f"[signals] {label} has the factor 0: every value is the same" in str(refusal.value)


def test_equal_names_in_two_messages_are_different_signals(tmp_path):
    text = change("IMU.AccZ", "MUX.AccZ") + 'join = "age"\nage_s = 0.01\n'
    rig = read_description(written(tmp_path, text))
    assert [axis.label for axis in rig.axes][2] == "MUX.AccZ"
    assert rig.axes[2].conditions[0].values == (1,)


def test_a_thermometer_of_another_file(tmp_path):
    path = written(tmp_path, change("ENV.Temp", "PROBE.T"))
    (tmp_path / "probe.dbc").write_text(
        'VERSION ""\nBU_: E\nBO_ 800 PROBE: 4 E\n SG_ T : 0|16@1- (0.01,0) [0|0] "K" E\n'
    )
    text = path.read_text().replace(
        'file = "imu.dbc"', 'file = "imu.dbc"\nmore_files = ["probe.dbc"]'
    )
    path.write_text(text)
    rig = read_description(path)
    assert rig.temperature.degc == (0.01, -273.15)
    assert [f.name for f in rig.bus_files] == ["imu.dbc", "probe.dbc"]


def test_another_unit_of_the_make_by_offset_and_address():
    tilter = read_description(find_description("tilter"))
    moved = tilter.moved(id_offset=0x40)
    ids = [use.layout.frame_id for use in moved.messages.values()]
    assert ids == [0x140, 0x141, 0x142, 0x143]
    assert [use.guard.frame_id for use in moved.messages.values()] == ids
    j1939 = read_description(find_description("j1939-inclinometer"))
    moved = j1939.moved(source_address=0x85)
    assert [u.layout.frame_id & 0xFF for u in moved.messages.values()] == [0x85, 0x85]
    assert not moved.messages["ACS"].layout.overlaps(j1939.messages["ACS"].layout)


@pytest.mark.parametrize("name", shipped_descriptions())
def test_shipped_descriptions_are_read_and_fit_their_units(tmp_path, name):
    setup = any_setup(tmp_path, name)
    setup.refuse_unfit()
    assert setup.rig.name == name
    assert setup.rig.warnings == ()


def test_every_shipped_description_is_tried():
    assert sorted(KINDS) == shipped_descriptions()


# ---- against the unit and the plan ----


def test_a_signal_narrower_than_the_adc_is_refused(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    wide = replace(setup.unit, adc=whole_adc(24, 2.5))
    with pytest.raises(RefusedError) as refusal:
        replace(setup, unit=wide).refuse_unfit()
    assert "IMU_AX.AX holds 0 to 65535" in str(refusal.value)
    assert "bits = 17, code_min = 0, code_max = 65535" in str(refusal.value)


def test_a_plan_whose_scale_is_not_the_bus_descriptions_is_refused(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    plan = replace(setup.plan, volts_per_g=(1.0, 1.1, 1.0))
    assert replace(setup, plan=plan).nominal.micro_g_per_code[1] > 0.0
    plan = replace(setup.plan, volts_per_g=(1.0, -1.1, 1.0))
    with pytest.raises(
        RefusedError, match=r"one code of y is -110\.973 micro-g \(with the other s"
    ):
        _ = replace(setup, plan=plan).nominal
    plan = replace(setup.plan, volts_per_g=(1.0, 1.0, 9.81))
    with pytest.raises(RefusedError, match=r"one code of z is 12\.4435 micro-g; expected about"):
        _ = replace(setup, plan=plan).nominal


def test_a_scale_that_nothing_states_is_refused(tmp_path):
    setup = any_setup(tmp_path, "tilter")
    plan = replace(setup.plan, volts_per_g=None)
    with pytest.raises(RefusedError, match=r"volts_per_g: missing.*no acceleration.*of x, y, z"):
        _ = replace(setup, plan=plan).nominal


def test_a_thermometer_that_is_not_the_units_is_refused(tmp_path):
    setup = any_setup(tmp_path, "automotive-imu")
    sensor = replace(setup.unit.temperature_sensor, degc_at_zero=-40.0)
    unit = replace(setup.unit, temperature_sensor=sensor)
    with pytest.raises(RefusedError, match=r"degc_per_code = 1, degc_at_zero = -50"):
        replace(setup, unit=unit).refuse_unfit()


def test_a_serial_number_without_a_number_is_refused(tmp_path):
    setup = any_setup(tmp_path, "canopen-float")
    unit = replace(setup.unit, serial="PROTOTYPE")
    with pytest.raises(RefusedError, match='"PROTOTYPE" has no number in it'):
        replace(setup, unit=unit).refuse_unfit()


def test_axes_of_two_scales_have_their_own_micro_g(tmp_path):
    rig = read_description(written(tmp_path))
    setup = any_setup(tmp_path, "tilter")
    plan = replace(setup.plan, volts_per_g=None)
    nominal = replace(setup, rig=rig, plan=plan).nominal
    assert nominal.micro_g_per_code.tolist() == pytest.approx([1000.0, 1000.0, 2000.0])


# ---- the plan ----


def test_a_plan_names_its_rig(tmp_path):
    setup = any_setup(tmp_path, "canopen-float")
    text = (tmp_path / "plan.toml").read_text()
    unit = read_unit(setup.folder)
    assert setup.plan.rig == find_description("canopen-float")
    path = written(tmp_path)
    for name in ("rig.toml", ".", str(path)):
        (tmp_path / "plan.toml").write_text(text.replace('"canopen-float"', f'"{name}"'))
        assert read_plan(tmp_path / "plan.toml", unit).rig.resolve() == path.resolve()
    (tmp_path / "plan.toml").write_text(text.replace("canopen-float", "canopen-flot"))
    with pytest.raises(RefusedError, match='did you mean "canopen-float"'):
        read_plan(tmp_path / "plan.toml", unit)
    (tmp_path / "plan.toml").write_text(text.replace("rig =", 'layout = "fd"\nrig ='))
    with pytest.raises(RefusedError, match=r"\[rig\] layout: found 'fd'; expected rig alone"):
        read_plan(tmp_path / "plan.toml", unit)


def test_what_cannot_be_detected_is_said():
    said = {n: " ".join(undetected(read_description(find_description(n)))) for n in KINDS}
    assert said["tilter"] == said["tilter-fd"] == ""
    assert "no serial number" in said["automotive-imu"]
    assert "CRC" not in said["automotive-imu"]
    for word in ("TPDO2 has no counter", "no CRC", "up to 4 ms old", "no status"):
        assert word in said["canopen-float"]

"""What a log of an IMU may be by its unit.toml: counts, two files, reversed forces, wrong units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynamic_cases import UNIT_TOML, mems_short, table_of, write_unit
from triaxcal.base.errors import RefusedError
from triaxcal.dynamic.description import read_dynamic
from triaxcal.dynamic.reading import read_recording
from triaxcal.dynamic.recording import ImuRecording, ImuSamples
from triaxcal.dynamic.survey import survey
from triaxcal.dynamic.unit import calibrate_described
from triaxcal.dynamic.upright import force_at_first_rest, upright
from triaxcal.model.types import FloatArray

G = 9.80665
COUNTS_TOML = UNIT_TOML.replace('"rad/s"', '"count"\nrate_counts_per_deg_per_s = 1048.576').replace(
    '"m/s^2"', '"count"\nforce_counts_per_g = 65536'
)
RATE_COUNT, FORCE_COUNT = np.radians(1) / 1048.576, G / 65536


def table() -> FloatArray:
    return table_of(mems_short()[1])


def recorded(folder: Path) -> ImuRecording:
    return read_recording(read_dynamic(folder))


def added(*lines: str) -> str:
    return UNIT_TOML.replace("[noise]", "\n".join([*lines, "[noise]"]))


def counts() -> FloatArray:
    rows = table()
    rows[:, 1:4] = np.rint(rows[:, 1:4] / RATE_COUNT)
    rows[:, 4:7] = np.rint(rows[:, 4:7] / FORCE_COUNT)
    return rows


@pytest.mark.parametrize("middle", [0, 2**15, 2**19])
def test_counts_of_a_nominal_size(middle: int, tmp_path: Path) -> None:
    """Without sign they are counted from the middle of their range, here of 16 and 20 bits."""
    rows = counts()
    if middle == 2**15:
        rows[:, 1:7] = np.rint(rows[:, 1:7] / 16)
    rows[:, 1:7] += middle
    toml = COUNTS_TOML
    size = 16.0 if middle == 2**15 else 1.0
    if size > 1:
        toml = toml.replace("1048.576", "65.536").replace("65536", "4096")
    found = recorded(write_unit(tmp_path / "IMU-A", rows, toml))
    exact = mems_short()[1].all()  # rounded once, or to a sixteenth of a count before
    assert np.abs(found.all().rate - exact.rate).max() <= 0.54 * size * RATE_COUNT
    assert np.abs(found.all().force - exact.force).max() <= 0.54 * size * FORCE_COUNT
    told = [f for f in found.findings if "counts without sign" in f]
    assert len(told) == (2 if middle else 0)
    assert all(f"{middle} is taken off" in f for f in told)


def test_counts_and_their_size_belong_together(tmp_path: Path) -> None:
    bare = COUNTS_TOML.replace("force_counts_per_g = 65536\n", "")
    with pytest.raises(RefusedError, match='force_unit: "count" and no force_counts_per_g'):
        read_dynamic(write_unit(tmp_path / "IMU-A", counts()[:300], bare))
    both = added("force_counts_per_g = 16384")
    with pytest.raises(
        RefusedError, match=r"force_counts_per_g: given, and force_unit is 'm/s\^2'"
    ):
        read_dynamic(write_unit(tmp_path / "IMU-B", table()[:300], both))


def forces_csv(rows: FloatArray) -> str:
    return "\n".join(["t,ax,ay,az", *(",".join(map(repr, row)) for row in rows.tolist()), ""])


def test_accelerometers_with_a_file_of_their_own(tmp_path: Path) -> None:
    """At half the rate and 3 ms off: used at their own instants, and no row is needed twice."""
    rows = table()
    own = rows[::2, [0, 4, 5, 6]].copy()
    middle = own.copy()
    middle[:, 0] += 0.003
    for k in (1, 2, 3):  # what the forces are 3 ms later, by a cubic through the exact samples
        middle[:, k] = _later(rows[:, 0], rows[:, k + 3], middle[:, 0])
    bare = rows.copy()
    bare[:, 4:7] = 0.0  # these columns must not be read
    toml = added('force_recording = "acc.csv"', 'force_time_column = "t"')
    folder = write_unit(tmp_path / "IMU-A", bare, toml)
    (folder / "acc.csv").write_text(forces_csv(middle), encoding="utf-8")
    found = recorded(folder)
    assert found.force_hz == pytest.approx(25.0)
    assert found.rate_hz == pytest.approx(50.0)
    samples = found.all()
    k = np.rint((samples.time_s - rows[0, 0]) * 50).astype(int)
    assert np.array_equal(samples.rate, rows[k, 1:4])
    # Noise of 100 micro-g/sqrt(Hz) at 50 Hz is 7 mm/s^2 in both; a shift of 3 ms at 1 rad/s would
    # be 30 mm/s^2.
    assert np.sqrt(np.mean((samples.force - rows[k, 4:7]) ** 2)) < 2 * 7e-3
    assert (folder / "acc.csv") in read_dynamic(folder).inputs


def _later(time_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    first = np.clip(np.searchsorted(time_s, at_s) - 2, 0, len(time_s) - 4)
    index = first[:, None] + np.arange(4)
    weights = np.ones((len(at_s), 4))
    for j in range(4):
        for k in {0, 1, 2, 3} - {j}:
            weights[:, j] *= (at_s - time_s[index[:, k]]) / (
                time_s[index[:, j]] - time_s[index[:, k]]
            )
    return np.asarray((weights * values[index]).sum(axis=1))


def test_files_without_a_time_in_common(tmp_path: Path) -> None:
    rows = table()
    folder = write_unit(
        tmp_path / "IMU-A", rows, added('force_recording = "acc.csv"', 'force_time_column = "t"')
    )
    other = rows[:, [0, 4, 5, 6]] + np.array([1e4, 0, 0, 0])
    (folder / "acc.csv").write_text(forces_csv(other), encoding="utf-8")
    with pytest.raises(RefusedError, match="gyros and accelerometers have no time in common"):
        recorded(folder)


def test_reversed_forces_by_the_axis_that_points_up(tmp_path: Path) -> None:
    rows = table()
    plain = recorded(write_unit(tmp_path / "IMU-A", rows))
    rows[:, 4:7] *= -1
    up = "xyz"[int(np.argmax(np.abs(plain.all().force[0])))]
    sign = "+" if plain.all().force[0]["xyz".index(up)] > 0 else "-"
    folder = write_unit(tmp_path / "IMU-B", rows, added(f'up_at_start = "{sign}{up}"'))
    unit = read_dynamic(folder)
    turned, found = upright(unit, read_recording(unit))
    assert np.array_equal(found.all().force, plain.all().force)
    assert "forces reversed" in found.findings[-1]
    force = next(q for q in turned.quantities if q.name == "force")
    assert (force.convert(np.ones((1, 3))) == -1.0).all()  # the C takes the codes so
    right = read_dynamic(tmp_path / "IMU-A")
    same = replace(right, up_at_start=f"{sign}{up}")
    assert upright(same, plain) == (same, plain)
    other = "xyz"["zxy".index(up)]
    with pytest.raises(RefusedError, match=rf"up_at_start: \+{other}, but at the first rest {up}"):
        upright(replace(right, up_at_start=f"+{other}"), plain)
    told = upright(right, plain)[1].findings[-1]
    assert "forces of reversed sign would look the same" in told


def test_nothing_but_the_rest_shows_reversed_forces(tmp_path: Path) -> None:
    """The turning data fit as well with the other sign: so it is said to be undecidable."""
    rows = table()
    plain = calibrate_described(read_dynamic(write_unit(tmp_path / "IMU-A", rows)))
    rows[:, 4:7] *= -1
    turned = calibrate_described(read_dynamic(write_unit(tmp_path / "IMU-B", rows)))
    fit, other = (done.result.passes[-1] for done in (plain, turned))
    # The Earth's rate about the vertical is all that differs, and coarse gyros do not see it.
    assert abs(other.chi_square - fit.chi_square) < 1.0
    assert not any(effect.shown for effect in turned.off)
    assert "would look the same" in turned.findings[-1]


MIXED = {
    "increments of the gyros as instants": (
        lambda rows: rows[:, 1:4].__imul__(0.02),
        UNIT_TOML,
        ("50 times as fast as the gyros measure (increments taken for instants?)", "rate_samples"),
    ),
    "increments of the forces as instants": (
        lambda rows: rows[:, 4:7].__imul__(0.02),
        UNIT_TOML,
        ("m/s^2 (increments taken for instants?)", "force_samples"),
    ),
    "instants of the gyros as increments": (
        lambda rows: None,  # noqa: ARG005
        UNIT_TOML.replace('"rad/s"', '"rad"').replace(
            'rate_samples = "instant"', 'rate_samples = "increment"'
        ),
        ("0.02 times as fast as the gyros measure", "(instants taken for increments?)"),
    ),
}


@pytest.mark.parametrize("case", MIXED)
def test_samples_and_increments_mixed(case: str, tmp_path: Path) -> None:
    spoil, toml, words = MIXED[case]
    rows = table()
    spoil(rows)
    with pytest.raises(RefusedError) as refusal:
        survey(recorded(write_unit(tmp_path / "IMU-A", rows, toml)))
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


def test_times_of_another_unit(tmp_path: Path) -> None:
    rows = table()
    rows[:, 0] *= 1000
    folder = write_unit(tmp_path / "IMU-A", rows)
    with pytest.raises(RefusedError, match=r"a sample every 20 s; .*time_unit in \[dynamic\], "):
        recorded(folder)
    rows[:, 0] /= 1e6
    with pytest.raises(RefusedError, match=r"samples in 0\.187 s; expected rests and turns"):
        recorded(write_unit(tmp_path / "IMU-B", rows))


def test_no_more_is_read_than_up_to_the_first_rest(tmp_path: Path) -> None:
    """Pieces of half a second, of which a hand moves the first twelve; the rest is in two of them.

    Pieces are taken one, then two, four and so on.
    """
    unit = read_dynamic(write_unit(tmp_path / "IMU-A", table()))
    whole = read_recording(unit)
    rate_hz, taken = round(whole.rate_hz), []
    n = 100 * rate_hz
    time_s = np.arange(1, n + 1) / rate_hz
    force = np.tile([0.0, 9.8, 0.0], (n, 1))
    moving = time_s < 6.2
    force[moving, 0] = 5.0 * np.sin(20.0 * time_s[moving])
    force[time_s > 7.5] = [0.0, 0.0, 9.8]
    samples = ImuSamples(time_s, np.zeros((n, 3)), force)

    def pieces() -> Iterator[ImuSamples]:
        for k in range(0, n, rate_hz // 2):
            taken.append(k)
            yield samples[k : k + rate_hz // 2]

    assert force_at_first_rest(replace(whole, pieces=pieces)) == pytest.approx([0.0, 9.8, 0.0])
    assert len(taken) <= 32  # of 200: 16 s, twice what the rest needs

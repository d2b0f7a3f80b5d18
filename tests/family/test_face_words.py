"""Messages of a unit with labelled faces name the faces and the unit of its readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from family_cases import write_unit

import triaxcal
from triaxcal.base.errors import RefusedError

G = 9.80665
FACES = {
    "+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}  # fmt: skip
K = np.eye(3) + np.array([[0.01, 0.004, -0.003], [0.002, -0.008, 0.001], [-0.003, 0.002, 0.005]])


def unit_of(folder: Path, labels: dict[str, str], dead: int | None = None) -> Path:
    """Six sections of 3 s in m/s^2; `labels` are wrong ones by the face that was up."""
    rng = np.random.default_rng(2)
    lines = ["a,b,c,label"]
    for face, up in FACES.items():
        readings = G * (K @ np.array(up)) + 0.05 + 0.01 * rng.standard_normal((300, 3))
        if dead is not None:
            readings[:, dead] = 0.05
        label = labels.get(face, face)
        lines += [",".join([*(f"{v:.5f}" for v in row), label]) for row in readings]
    rows = (
        'acceleration = [1, 2, 3]\nacceleration_unit = "m/s^2"\nsample_rate_hz = 100\n'
        'section = "label"\n[recording.faces]\n' + "\n".join(f'"{f}" = "{f}"' for f in FACES)
    )
    made = write_unit(folder, np.zeros((1, 3)), rows, header="a,b,c")
    for path in made.glob("*.csv"):
        path.write_text("\n".join(lines) + "\n")
    return made


def refusal_of(folder: Path) -> str:
    with pytest.raises(RefusedError) as refusal:
        triaxcal.fit(triaxcal.read_unit(folder))
    return str(refusal.value)


def test_exchanged_faces(tmp_path: Path) -> None:
    told = refusal_of(unit_of(tmp_path / "U", {"+x": "+y", "+y": "+x"}))
    assert "face +y and face +x look exchanged at" in told
    assert "(m/s^2)/g as recorded" in told
    assert "TP" not in told
    assert "V/g" not in told
    # 1.01, 0.992 and 1.005 of 9.80665.
    assert "(+9.905, +9.728, +9.856) (m/s^2)/g with the exchange undone" in told


def test_a_face_upside_down(tmp_path: Path) -> None:
    folder = unit_of(tmp_path / "U", {"+x": "-x", "-x": "+x"})
    told = refusal_of(folder)
    assert "face -x and face +x exchanged throughout or half a turn of the unit about x (" in told
    text = str(triaxcal.diagnose(folder))
    assert "face -x and face +x" in text
    assert "measure face " in text
    assert "TP" not in told + text


def test_a_dead_output_is_named_once_in_its_unit(tmp_path: Path) -> None:
    told = refusal_of(unit_of(tmp_path / "U", {}, dead=2))
    assert ": Uz does not respond to gravity: it stays within 0 m/s^2 in all dwells, while" in told
    assert told.count("Uz") == 1
    assert " mV" not in told


def test_a_sound_unit_is_not_spoken_of_otherwise(tmp_path: Path) -> None:
    found = triaxcal.fit(triaxcal.read_unit(unit_of(tmp_path / "U", {})))
    np.testing.assert_allclose(found.constants(20.0)[0] / G, K, atol=1e-3)


def test_a_cause_without_a_place_is_listed_once(tmp_path: Path) -> None:
    """ "unknown" is tried with several noises; a reader sees one."""
    rng = np.random.default_rng(1)
    up = rng.normal(size=(24, 3))
    values = up / np.linalg.norm(up, axis=1)[:, None] + 2e-4 * rng.normal(size=(24, 3))
    values[:, 2] = 0.01
    rows = 'rows = "poses"\nacceleration = [1, 2, 3]\nacceleration_unit = "g"'
    found = triaxcal.diagnose(write_unit(tmp_path / "U", values, rows, header="a,b,c"))
    names = [s.name for s in found.suspects]
    assert "unknown" in names
    assert len(set(names)) == len(names)

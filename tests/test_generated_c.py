"""The generated C as programs: every shape, every optimisation, under sanitizers; and mutants."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import pytest

import oracle
from builds import Built, write_generated
from mutants import MUTANTS, Mutant
from plans import (
    COVERING,
    GOLDEN,
    INT32_MAX,
    disturbed,
    integer_plan,
    random_plan,
    vectors,
)
from triaxcal.base.shipped import shipped
from triaxcal.codegen.compiler import FLAGS
from triaxcal.codegen.crosscheck import VectorSet, python_routine, vector_sets
from triaxcal.codegen.forms import form_of, limb_split, row_words
from triaxcal.codegen.image import image_bytes
from triaxcal.codegen.render import render_routine
from triaxcal.codegen.routines import Answers, Generated, Reference
from triaxcal.fixedpoint.plan import Plan
from triaxcal.unit.arithmetic import LIMBS, THUMB1, THUMB2
from triaxcal.verify.workspace import host_forms

MAIN = Path(__file__).parent / "run_vectors.c"
STRICT = [flag for flag in FLAGS if flag != "-O2"]
SANITIZERS = ["-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
BUILDS = {
    "O0": ["-O0"],
    "O2": ["-O2"],
    "Os": ["-Os"],
    "sanitized": SANITIZERS,
    "limbs": SANITIZERS,
}
JOBS = [
    # Most of the time of this file is the compiler's: the golden shapes stand for the others.
    pytest.param(shape, build, marks=[] if shape in GOLDEN else pytest.mark.long)
    for shape in (*COVERING, *GOLDEN)
    for build in BUILDS
    # "sanitized" is -O0 too, so -O0 alone and -Os run the golden shapes only: it saves seconds.
    if build not in ("O0", "Os") or shape in GOLDEN
]


# ---- vectors and images for the program ----


def adversarial_images(plan: Plan, rng: Random) -> list[tuple[bytes, int]]:
    """Images and the status that each must have: right, damaged, and at the limit of step R."""
    good = image_bytes(plan)
    images = [(good, 0), (b"", 16), (good[:-1], 16), (good + b"\0", 16), (bytes(len(good)), 16)]
    images += [(good[:size], 16) for size in (1, 3, 4, 60, len(good) - 4)]
    for _ in range(20):
        damaged = bytearray(good)
        damaged[rng.randrange(len(good))] ^= 1 << rng.randrange(8)
        images.append((bytes(damaged), 16))
    for _ in range(60):
        limit = random_plan(rng, plan.shape, full=True)
        over = rng.choice([-2, -1, 0, 0, 1, 2, 9, 2**20, -(2**31), 2**31])
        other = disturbed(rng, limit, over)
        images.append((image_bytes(other), 0 if oracle.keeps_step_r(other) else 16))
    return images


def input_file(plan: Plan, reference: Reference, rng: Random) -> bytes:
    temps, raws = vectors(plan, rng, 150)
    codes = np.array(temps, np.int32), np.array(raws, np.int32)
    words = [len(temps)]
    for temp, raw in zip(temps, raws, strict=True):
        accel, status = oracle.run(plan, temp, raw)
        words += [temp, *raw, *accel, status]
    images = adversarial_images(plan, rng)
    words.append(len(images))
    for image, status in images:
        words += [len(image), status, *image]
        if status == 0:
            answers = reference.routine(image)(*codes)
            words += np.column_stack(answers).astype(np.int32).ravel().tolist()
    return np.array(words, dtype=np.int32).tobytes()


def compile_program(
    folder: Path, name: str, flags: Sequence[str], routine: str = "triax_comp.c"
) -> Path:
    program = folder / f"run-{name}"
    command = ["gcc", *STRICT, *flags, f"-I{folder}", str(MAIN)]
    command += [str(folder / name) for name in (routine, "triax_calib.c")]
    done = subprocess.run(
        [*command, "-o", str(program)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return program


Programs = Callable[[str, str], Path]


@pytest.fixture(scope="module")
def programs(built: dict[str, Built], reference: Reference) -> Programs:
    """A shape in a build, compiled when it is asked for, with its input file beside it."""

    @cache
    def program(name: str, build: str) -> Path:
        b = built[name]
        inputs = b.folder / "vectors.bin"
        if not inputs.exists():
            inputs.write_bytes(input_file(b.plan, reference, Random(name)))
        routine = "triax_comp.c"
        if build == "limbs":
            routine = host_forms(b.plan).get(LIMBS, routine)
            texts = render_routine(replace(b.plan, arithmetic=LIMBS))
            (b.folder / routine).write_text(texts[routine])
        return compile_program(b.folder, build, BUILDS[build], routine)

    return program


def run_program(program: Path, vectors_file: Path) -> subprocess.CompletedProcess[str]:
    command = [str(program), str(vectors_file)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("name", "build"), JOBS)
def test_every_shape_runs_right_in_every_build(programs: Programs, name: str, build: str) -> None:
    program = programs(name, build)
    done = run_program(program, program.parent / "vectors.bin")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_program_notices_a_wrong_vector(programs: Programs, tmp_path: Path) -> None:
    program = programs("direct-checked", "sanitized")
    words = np.frombuffer((program.parent / "vectors.bin").read_bytes(), dtype=np.int32).copy()
    words[1 + 8 * 7 + 5] += 1  # accel[1] of the eighth vector
    (tmp_path / "vectors.bin").write_bytes(words.tobytes())
    done = run_program(program, tmp_path / "vectors.bin")
    assert done.returncode == 1
    assert done.stdout.startswith(f"temp_code {words[1 + 8 * 7]} raw_code ")


def test_the_sanitizers_are_awake(built: dict[str, Built], tmp_path: Path) -> None:
    """Without the loader's range proof, constants that overflow are loaded, and caught at work."""
    b = built["direct-order-0"]
    row = "        if (row_sum >= ROW_LIMIT) {\n            fits = 0u;"
    text = (b.folder / "triax_comp.c").read_text(encoding="utf-8")
    assert text.count(row) == 1
    for file in b.folder.glob("triax_*.[ch]"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "triax_comp.c").write_text(text.replace(row, row.replace("0u", "1u")))
    program = compile_program(tmp_path, "awake", SANITIZERS)
    raw = [b.plan.shape.raw_min] * 3
    accel, status = oracle.run(b.plan, 0, raw)
    n = -INT32_MAX  # three products of 2^62
    image = image_bytes(integer_plan(b.plan.shape, [[[n], [n], [n], [0]] * 3]))
    words = [1, 0, *raw, *accel, status, 1, len(image), 0, *image, 0, 0, 0, 0]
    (tmp_path / "vectors.bin").write_bytes(np.array(words, dtype=np.int32).tobytes())
    done = run_program(program, tmp_path / "vectors.bin")
    assert (done.returncode != 0, done.stdout) == (True, "")
    assert "signed integer overflow" in done.stderr


def test_the_shapes_split_raw_codes_in_every_way() -> None:
    """Limbs cut a code into halves, or multiplies in int64_t where they would not do."""
    splits = {limb_split(shape) for shape in COVERING.values()}
    assert {0, 3, 13} <= splits
    assert max(splits) == 13  # the most that its sums allow


# ---- mutants ----


@pytest.fixture(scope="module")
def shipped_vectors() -> dict[str, list[tuple[VectorSet, Answers]]]:
    """The vector sets of a delivery and what the Python model answers."""
    return {
        name: [(v, python_routine(plan)(v.temp, v.raw)) for v in vector_sets(plan)]
        for name, plan in GOLDEN.items()
    }


def gcc(source: Path, include: Path, *flags: str) -> None:
    """Compile without the strict flags: what a mutant does is tested, not how it looks."""
    common = ["gcc", "-std=c99", "-O1", "-fwrapv", "-w", "-fPIC", f"-I{include}"]
    command = [*common, f"-I{shipped('firmware_ref')}", str(source), *flags]
    subprocess.run(command, check=True)


@pytest.fixture(scope="module")
def batch_object(built: dict[str, Built]) -> dict[str, Path]:
    """The batch entry with each golden plan's constants, which no mutant changes."""
    objects = {name: built[name].folder / "batch.o" for name in GOLDEN}
    for name, made in objects.items():
        source = shipped("firmware_ref") / "triax_batch.c"
        gcc(source, built[name].folder, "-c", "-o", str(made))
    return objects


def mutant_library(folder: Path, batch: Path, mutant: Mutant) -> ctypes.CDLL:
    text = (batch.parent / "triax_comp.c").read_text(encoding="utf-8")
    assert mutant.old in text, "this text is no longer in the routine: write the mutant anew"
    source = folder / "triax_comp.c"
    source.write_text(text.replace(mutant.old, mutant.new, 1), encoding="utf-8")
    more = [str(batch), str(batch.parent / "triax_calib.c")]
    gcc(source, batch.parent, *more, "-shared", "-o", str(folder / "mutant.so"))
    return ctypes.CDLL(str(folder / "mutant.so"))


def killed_by(library: ctypes.CDLL, sets: list[tuple[VectorSet, Answers]]) -> str:
    """Name of the first vector set that tells the library from the model, or nothing."""
    for v, (accel, status) in sets:
        found = Generated(library).run(v.temp, v.raw)
        if (found[0] != accel).any() or (found[1] != status).any():
            return v.name
    return ""


@pytest.mark.parametrize(
    ("name", "mutant"),
    [pytest.param(name, m, id=f"{name}: {m.what}") for name, ms in MUTANTS.items() for m in ms],
)
def test_the_vectors_kill_the_mutant(
    batch_object: dict[str, Path],
    shipped_vectors: dict[str, list[tuple[VectorSet, Answers]]],
    tmp_path: Path,
    name: str,
    mutant: Mutant,
) -> None:
    library = mutant_library(tmp_path, batch_object[name], mutant)
    assert killed_by(library, shipped_vectors[name]), f"{mutant.what}: no vector sees it"


def test_the_unchanged_routine_survives(
    built: dict[str, Built], shipped_vectors: dict[str, list[tuple[VectorSet, Answers]]]
) -> None:
    for name, sets in shipped_vectors.items():
        assert killed_by(built[name].generated.library, sets) == ""


@pytest.mark.parametrize(
    ("form", "complaint"),
    [
        (THUMB2, "this is for cores with Thumb-2 (Cortex-M3, M4, M7, M33): compile triax_comp.c"),
        (THUMB1, "this is for little-endian cores with Thumb (Cortex-M0, M0+, M1): compile"),
    ],
)
def test_a_form_for_another_core_is_refused_by_name(
    form: str, complaint: str, tmp_path: Path
) -> None:
    write_generated(replace(GOLDEN["direct-checked"], arithmetic=form), tmp_path)
    command = ["gcc", "-std=c99", "-fsyntax-only", f"triax_comp_{form}.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert f'#error "{complaint}' in done.stderr


def test_the_macro_of_earlier_versions_is_refused(built: dict[str, Built]) -> None:
    """It would choose nothing in silence: a slower routine, or a state of another size."""
    command = ["gcc", "-std=c99", "-fsyntax-only", "-DTRIAX_ARITHMETIC=2", "triax_comp.c"]
    folder = built["direct-checked"].folder
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "state [firmware] arithmetic in unit.toml" in done.stderr


@pytest.mark.parametrize("name", [*COVERING, *GOLDEN])
def test_a_form_is_a_file_of_its_own_beside_the_same_portable_one(
    built: dict[str, Built], name: str
) -> None:
    plan = built.plans[name]
    portable = render_routine(plan)
    assert list(portable) == ["triax_comp.h", "triax_comp.c"]
    assert not any(w in portable["triax_comp.c"] for w in ("__asm__", "limb", "_half(", "#if"))
    for form in (LIMBS, THUMB2, THUMB1):
        asked = replace(plan, arithmetic=form)
        texts = render_routine(asked)
        assert texts["triax_comp.c"] == portable["triax_comp.c"]
        own = form_of(plan.shape, form)
        more = [] if own == "portable" else [f"triax_comp_{own}.c"]
        assert list(texts) == ["triax_comp.h", "triax_comp.c", *more]
        words = f"#define TRIAX_ROW_WORDS {row_words(plan.shape, own)}"
        assert words in texts["triax_comp.h"]

"""Bounded fuzzing: images against the generated loader and the reference, text against the parsers.

python fuzz/run.py [--seconds 60] [--units units] [--keep]

Each target gets an equal share of the time. What crashes a target is left in build/fuzz/ and named;
exit code 1 then. A missing tool is named and its targets count as not done. With --keep the corpus
is minimised and written back to fuzz/corpus/.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import struct
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from triaxcal.base.shipped import shipped
from triaxcal.base.tools import TOOLS, MissingToolError
from triaxcal.verify.outcome import FAILED, NOT_DONE, PASSED, Outcome
from triaxcal.verify.shapes import SHAPES, subject
from triaxcal.verify.table import table
from triaxcal.verify.tools import Answer, run
from triaxcal.verify.workspace import IMAGE, ROUTINE, Workspace

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
CLANG = TOOLS["clang"]
FLAGS = (
    "-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined",
    "-fno-sanitize-recover=undefined",
)  # fmt: skip
SEED = 1
HEADER_WORDS = 15
LARGEST_CORPUS = 24
"""Inputs a target keeps in the repository; those that libFuzzer found first."""

_RUNS = re.compile(r"stat::number_of_executed_units: (\d+)")
_COVERED = re.compile(r"cov: (\d+)")


@dataclass(frozen=True)
class Target:
    """A fuzz target: its command, its corpus, and the seeds made for it."""

    name: str
    command: tuple[str, ...]
    seeds: tuple[bytes, ...]
    largest: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Run every target and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60, help="time for all targets together")
    parser.add_argument("--units", type=Path, default=HERE.parent / "units")
    parser.add_argument("--keep", action="store_true", help="write the corpus back, minimised")
    given = parser.parse_args(arguments)
    work = HERE.parent / "build" / "fuzz"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    targets: list[Target] = []
    outcomes: list[Outcome] = []
    for name, make in _makers(given.units, work).items():
        try:
            targets.append(make())
        except MissingToolError as missing:
            outcomes.append(Outcome(name, name, NOT_DONE, str(missing)))
    share = max(1, given.seconds // max(1, len(targets)))
    outcomes += [_fuzz(target, work, share, given.keep) for target in targets]
    print(table({"": outcomes}))
    return int(any(o.result == FAILED for o in outcomes))


def _makers(units: Path, work: Path) -> dict[str, object]:
    makers = {f"load-{shape}": lambda shape=shape: _load(shape, units, work) for shape in SHAPES}
    makers["reference"] = lambda: _reference(units, work)
    makers["xcp"] = lambda: _xcp(units, work)
    makers["unit.toml"] = lambda: _parser("unit.toml", units)
    makers["measurements.csv"] = lambda: _parser("measurements.csv", units)
    return makers


def _load(shape: str, units: Path, work: Path) -> Target:
    """triax_calib_load, set_temperature and apply of one shape."""
    made = subject(shape, units)
    space = Workspace.create(work / shape, made.files, made.plan, made.bound)
    image = made.files[IMAGE]
    # Version 2 has a word more: which terms there are.
    words = HEADER_WORDS + int.from_bytes(image[4:8], "little") - 1
    header = ",".join(f"{w}u" for w in struct.unpack(f"<{words}I", image[: 4 * words]))
    program = space.folder / "load"
    sources = [HERE / "load.c", space.folder / ROUTINE, *_reference_sources()]
    _compile(
        program, sources, [space.folder], [f"-DFUZZ_HEADER={header}", f"-DHEADER_WORDS={words}"]
    )
    return Target(
        f"load-{shape}", (str(program),), (image, image + bytes(range(64))), len(image) + 64
    )


def _reference(units: Path, work: Path) -> Target:
    """triax_ref_open."""
    program = work / "reference"
    _compile(program, [HERE / "reference.c", *_reference_sources()], [], [])
    seeds = tuple(subject(shape, units).files[IMAGE] for shape in SHAPES)
    return Target("reference", (str(program),), seeds, 4096)


def _xcp(units: Path, work: Path) -> Target:
    """The XCP slave and its store, with the loader of the first shape."""
    made = subject(next(iter(SHAPES)), units)
    space = Workspace.create(work / "xcp", made.files, made.plan, made.bound)
    folder = shipped("firmware_ref") / "xcp"
    sources = [HERE / "xcp.c", *sorted(folder.glob("*.c")), space.folder / ROUTINE]
    program = space.folder / "xcp"
    image = made.files[IMAGE]
    words = ",".join(str(byte) for byte in image)
    _compile(program, sources, [space.folder, folder], [f"-DFUZZ_FILE={words}"])
    return Target("xcp", (str(program),), _sessions(image), 4096)


def _sessions(image: bytes) -> tuple[bytes, ...]:
    """Packets, each after its size: a download that is stored, every command, a change."""
    start = [b"\xff\0", b"\xeb\x02\0\x01", b"\xf6" + bytes(7)]
    parts = [image[at : at + 6] for at in range(0, len(image), 6)]
    down = [bytes([0xF0, len(part)]) + part for part in parts]
    codes = (0xFD, 0xFC, 0xFA, 0xF5, 0xF4, 0xF3, 0xEA, 0xE4, 0xFE)
    each = [bytes([code, 1, 0, 0, 1, 0, 0, 0]) for code in codes]
    in_ram = [b"\xff\0", b"\xe4\0\0\0\x01", b"\xeb\x03\0\x01", b"\xfa\x05"]
    change = [b"\xf6\0\0\x03" + bytes([80, 0, 0, 0]), b"\xf0\x04" + image[80:84], b"\xfa\x05"]
    sessions = (
        [*start, *down, b"\xf9\x01", b"\xeb\x03\0\x01"],
        [b"\xff\0", *each],
        [*in_ram, *change, b"\xf9\x01"],
    )
    return tuple(b"".join(bytes([len(p)]) + p for p in packets) for packets in sessions)


def _parser(file: str, units: Path) -> Target:
    """The reader of a unit's file, under atheris."""
    if importlib.util.find_spec("atheris") is None:
        raise MissingToolError("atheris not found; .venv/bin/pip install -e '.[fuzz]'")
    seeds = tuple((units / name / file).read_bytes() for name in ("AT-SIM", "AT-CHERNIAK"))
    command = (sys.executable, str(HERE / "parsers.py"), file)
    return Target(file, command, seeds, 8192)


def _reference_sources() -> list[Path]:
    folder = shipped("firmware_ref")
    return [folder / "triax_ref.c", folder / "triax_ref_image.c"]


def _compile(program: Path, sources: list[Path], include: list[Path], more: list[str]) -> None:
    folders = [HERE, shipped("firmware_ref"), *include]
    command = [
        CLANG.find(), *FLAGS, *more, *(f"-I{folder}" for folder in folders),
        "-o", str(program), *map(str, sources),
    ]  # fmt: skip
    answer = run(command, HERE)
    if answer.code and "cannot find" in answer.text and "libclang_rt" in answer.text:
        raise MissingToolError(f"clang has no libFuzzer; {CLANG.install_command()}")
    if answer.code:
        raise SystemExit(f"fuzz: {program.name} does not compile:\n{answer.text}")


def _fuzz(target: Target, work: Path, seconds: int, keep: bool) -> Outcome:
    """Run a target on its corpus and its seeds."""
    grown = work / f"corpus-{target.name}"
    grown.mkdir()
    for number, seed in enumerate(target.seeds):
        (grown / f"seed-{number}").write_bytes(seed)
    kept = CORPUS / target.name
    for path in sorted(kept.iterdir()) if kept.is_dir() else []:
        shutil.copy(path, grown / path.name)
    command = [
        *target.command, str(grown), f"-max_total_time={seconds}", f"-seed={SEED}",
        f"-max_len={target.largest}", "-print_final_stats=1", "-timeout=20", "-rss_limit_mb=4096",
        f"-artifact_prefix={work}/{target.name}-",
    ]  # fmt: skip
    answer = run(command, work)
    runs, covered = _RUNS.search(answer.text), _COVERED.findall(answer.text)
    if answer.code or runs is None:
        return Outcome(target.name, target.name, FAILED, *_complaint(answer, work))
    if keep:
        _keep(target, grown, kept, work)
    finding = f"{int(runs.group(1))} inputs, {covered[-1] if covered else 0} edges, no complaint"
    return Outcome(target.name, target.name, PASSED, finding)


def _complaint(answer: Answer, work: Path) -> tuple[str, dict[str, object], tuple[str, ...]]:
    lines = answer.text.splitlines()
    told = [line for line in lines if "ERROR" in line or "error" in line or "Exception" in line]
    return f"a complaint; the input lies in {work}", {}, tuple((told or lines[-10:])[:10])


def _keep(target: Target, grown: Path, kept: Path, work: Path) -> None:
    """The smallest corpus that covers the same edges, without what is made anew each time."""
    merged = work / f"merged-{target.name}"
    merged.mkdir()
    run([*target.command, "-merge=1", f"-max_len={target.largest}", str(merged), str(grown)], work)
    shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True)
    found = sorted(p for p in merged.iterdir() if p.read_bytes() not in target.seeds)
    for path in found[:LARGEST_CORPUS]:
        shutil.copy(path, kept / path.name)


if __name__ == "__main__":
    sys.exit(main())

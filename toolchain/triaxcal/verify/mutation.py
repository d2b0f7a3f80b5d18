"""Mutation testing: the shipped vector set has to find every small mistake in C and constants.

Every mutant of triax_comp.c, of each integer in triax_calib.c and of each word of the image is
compiled (or loaded) and run on the very vectors and images of the cross-check. One that no vector
finds gets a second chance under sanitizers, as `triaxcal verify` runs them: reading out of bounds
need not change a result. What still survives must be on file as equivalent, with a reason.
"""

from __future__ import annotations

import re
import struct
import subprocess
import tomllib
import zlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from triaxcal.codegen.compiler import FLAGS as DELIVERY_FLAGS
from triaxcal.codegen.names import Names, names_of
from triaxcal.codegen.templates import environment
from triaxcal.unit.arithmetic import LIMBS
from triaxcal.verify.analyzers import GCC, SANITIZERS
from triaxcal.verify.c_mutants import Mutant, mutants_of
from triaxcal.verify.mutation_inputs import write_images, write_vectors
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import CONSTANTS, HEADERS, IMAGE, ROUTINE, Workspace

EQUIVALENTS = Path(__file__).with_name("equivalent_mutants.toml")
KILLED = "killed by the vectors"
BY_SANITIZER = "killed under sanitizers"
BY_COMPILER = "refused by the compiler's warnings"
EQUIVALENT = "equivalent"
STILLBORN = "does not compile"
SURVIVED = "survived"
FATES = (KILLED, BY_SANITIZER, BY_COMPILER, EQUIVALENT, STILLBORN, SURVIVED)
FLAGS = ("-std=c99", "-O1", "-fwrapv", "-w", "-DCPU_SECONDS=5")
SANITIZED = ("-std=c99", "-O1", "-w", "-g", *SANITIZERS[0].flags, "-DCPU_SECONDS=60")
"""-fwrapv: what a mutant does shall not depend on what the compiler makes of an overflow."""

LIMBS_ROUTINE = "triax_comp_limbs.c"
ROUTINES = (ROUTINE, LIMBS_ROUTINE)

_INTEGER = re.compile(r"^ +(\(-2147483647 - 1\)|-?\d+), /\*", re.MULTILINE)


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant."""

    mutant: Mutant
    fate: str


@dataclass(frozen=True)
class Equivalent:
    """A change on file that no input can show; "*" stands for any text.

    Attributes
    ----------
    function : str
        Where it is.
    before, after : str
        Line without and with the change.
    reason : str
        Why no input shows it.
    shapes : tuple of str
        Where that holds; empty for every shape.
    """

    function: str
    before: str
    after: tuple[str, ...]
    reason: str
    shapes: tuple[str, ...] = ()

    def covers(self, mutant: Mutant, shape: str) -> bool:
        """Whether the mutant of a shape is this one."""
        return (
            _like(self.function, mutant.function)
            and (not self.shapes or shape in self.shapes)
            and _like(self.before, mutant.before)
            and any(_like(text, mutant.after) for text in self.after)
        )


def _like(pattern: str, text: str) -> bool:
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*~"))), text) is not None


def read_equivalents(names: Names) -> tuple[Equivalent, ...]:
    """The equivalent mutants on file, with the names in the C of a triad."""
    text = environment().from_string(EQUIVALENTS.read_text(encoding="utf-8")).render(names.context)
    return tuple(
        Equivalent(
            e["function"],
            e["before"],
            tuple(e["after"]),
            " ".join(e["reason"].split()),
            tuple(e.get("shapes", ())),
        )
        for e in tomllib.loads(text)["equivalent"]
    )


class Bench:
    """One shape's vectors, answers and images on disk, and what runs mutants on them."""

    def __init__(self, work: Workspace, shape: str) -> None:
        self.work = work
        self.shape = shape
        folder = work.folder / "bench"
        folder.mkdir()
        # Away from the unit's files, or it would include those rather than the mutant's.
        self.harness = work.render("bench/verify_mutant.c", "verify/mutant.c.j2", {})
        self.vectors, self.answers, self.images = (
            folder / f"verify_mutant.{name}" for name in ("vectors", "answers", "images")
        )
        write_vectors(work.plan, self.vectors, self.answers)
        write_images(work, self.images)

    def survives(
        self,
        folder: Path,
        flags: Sequence[str] = FLAGS,
        file: str = ROUTINE,
        image: Path | None = None,
    ) -> bool | None:
        """Run what is in `folder`, changed or not; None when it does not compile.

        `file` is that of the routine's form, where it is one, by the name of an accelerometer's.
        """
        routine = file if file in ROUTINES else ROUTINE
        program = folder / "mutant"
        command = [
            GCC.find(), *flags, f"-I{folder}", "-o", str(program),
            str(self.harness), *(str(folder / self.work.named(f)) for f in (routine, CONSTANTS)),
        ]  # fmt: skip
        if run(command, folder).code:
            return None
        arguments = [program, self.vectors, self.answers, self.images, *([image] if image else [])]
        code = subprocess.run(arguments, capture_output=True, check=False).returncode
        if code == 2:
            raise BrokenToolError("the harness of the mutants was called wrongly")
        return code == 0


def _is_clean(folder: Path, routine: str) -> bool:
    """Whether the delivery would compile it: there every warning is an error."""
    command = [GCC.find(), *DELIVERY_FLAGS, "-c", "-o", "/dev/null", routine]
    return not run(command, folder).code


def c_campaign(bench: Bench, every: int = 1) -> list[Verdict]:
    """Mutants of triax_comp.c, each `every`-th."""
    source = (bench.work.folder / bench.work.named(ROUTINE)).read_text(encoding="utf-8")
    return judge_all(bench, mutants_of(source)[::every], ROUTINE)


def limbs_campaign(bench: Bench, every: int = 1) -> list[Verdict]:
    """Mutants of the functions of triax_comp_limbs.c that triax_comp.c does not have."""
    if LIMBS not in bench.work.forms:
        return []
    source = (bench.work.folder / bench.work.forms[LIMBS]).read_text(encoding="utf-8")
    known = {
        (m.function, m.before, m.after)
        for m in mutants_of(
            (bench.work.folder / bench.work.named(ROUTINE)).read_text(encoding="utf-8")
        )
    }
    own = [m for m in mutants_of(source) if (m.function, m.before, m.after) not in known]
    return judge_all(bench, own[::every], LIMBS_ROUTINE)


def constants_campaign(bench: Bench, every: int = 1) -> list[Verdict]:
    """Each integer of triax_calib.c one up and one down."""
    source = (bench.work.folder / bench.work.named(CONSTANTS)).read_text(encoding="utf-8")
    mutants = []
    for match in _INTEGER.finditer(source):
        value = -(2**31) if match.group(1).startswith("(") else int(match.group(1))
        for other in (value - 1, value + 1):
            if not -(2**31) < other < 2**31:
                continue
            changed = source[: match.start(1)] + str(other) + source[match.end(1) :]
            line = source.count("\n", 0, match.start(1))
            before, after = (text.split("\n")[line].strip() for text in (source, changed))
            mutants.append(Mutant("TRIAX_CALIB", line + 1, before, after, changed))
    return judge_all(bench, mutants[::every], CONSTANTS)


def image_campaign(bench: Bench, every: int = 1) -> list[Verdict]:
    """Each word of the image one up and one down, the CRC made right again."""
    image = bench.work.image
    words = struct.unpack(f"<{len(image) // 4}I", image)[:-1]
    folder = bench.work.folder / "image"
    _fill(folder, bench.work)
    verdicts = []
    for at, word in list(enumerate(words))[::every]:
        for other in ((word + 1) % 2**32, (word - 1) % 2**32):
            payload = struct.pack(f"<{len(words)}I", *words[:at], other, *words[at + 1 :])
            path = folder / "changed.bin"
            path.write_bytes(payload + struct.pack("<I", zlib.crc32(payload)))
            mutant = Mutant(IMAGE, at, str(word), str(other), "")
            fate = SURVIVED if bench.survives(folder, image=path) else KILLED
            verdicts.append(Verdict(mutant, fate))
    return verdicts


def judge_all(bench: Bench, mutants: Sequence[Mutant], file: str) -> list[Verdict]:
    """What becomes of mutants of one file, in their order."""
    equivalents = read_equivalents(names_of(bench.work.plan))

    def judge(item: tuple[int, Mutant]) -> Verdict:
        number, mutant = item
        folder = bench.work.folder / f"mutant_{file}_{number}"
        _fill(folder, bench.work)
        (folder / bench.work.named(file)).write_text(mutant.source, encoding="utf-8")
        survives = bench.survives(folder, file=file)
        if survives is None:
            fate = STILLBORN
        elif not survives:
            fate = KILLED
        elif any(e.covers(mutant, bench.shape) for e in equivalents):
            fate = EQUIVALENT
        elif not bench.survives(folder, SANITIZED, file):
            fate = BY_SANITIZER
        elif file in ROUTINES and not _is_clean(folder, bench.work.named(file)):
            fate = BY_COMPILER
        else:
            fate = SURVIVED
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
        return Verdict(mutant, fate)

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(judge, enumerate(mutants)))


def _fill(folder: Path, work: Workspace) -> None:
    folder.mkdir(exist_ok=True)
    for name in (*work.forms.values(), *map(work.named, (CONSTANTS, *HEADERS))):
        (folder / name).write_bytes((work.folder / name).read_bytes())


Campaign = Callable[[Bench, int], list[Verdict]]

CAMPAIGNS: Mapping[str, Campaign] = {
    ROUTINE: c_campaign,
    LIMBS_ROUTINE: limbs_campaign,
    "triax_calib.c": constants_campaign,
    "triax_calib.bin": image_campaign,
}
"""What is mutated, and how."""

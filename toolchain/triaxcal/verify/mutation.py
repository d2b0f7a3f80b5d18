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
from triaxcal.verify.analyzers import GCC, SANITIZERS
from triaxcal.verify.c_mutants import Mutant, mutants_of
from triaxcal.verify.mutation_inputs import write_images, write_vectors
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import CONSTANTS, FORMS, HEADERS, IMAGE, ROUTINE, Workspace

EQUIVALENTS = Path(__file__).with_name("equivalent_mutants.toml")
KILLED = "killed by the vectors"
BY_SANITIZER = "killed under sanitizers"
BY_COMPILER = "refused by the compiler's warnings"
EQUIVALENT = "equivalent"
ELSEWHERE = "for another core"
STILLBORN = "does not compile"
SURVIVED = "survived"
FATES = (KILLED, BY_SANITIZER, BY_COMPILER, EQUIVALENT, ELSEWHERE, STILLBORN, SURVIVED)
FLAGS = ("-std=c99", "-O1", "-fwrapv", "-w", "-DCPU_SECONDS=5")
SANITIZED = ("-std=c99", "-O1", "-w", "-g", *SANITIZERS[0].flags, "-DCPU_SECONDS=60")
"""-fwrapv: what a mutant does shall not depend on what the compiler makes of an overflow."""

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
            mutant.function == self.function
            and (not self.shapes or shape in self.shapes)
            and _like(self.before, mutant.before)
            and any(_like(text, mutant.after) for text in self.after)
        )


def _like(pattern: str, text: str) -> bool:
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*~"))), text) is not None


def read_equivalents(names: Names) -> tuple[Equivalent, ...]:
    """The equivalent mutants on file, with the names in the C of a triad."""
    text = environment().from_string(EQUIVALENTS.read_text()).render(names.context)
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

    def survives(self, folder: Path, flags: Sequence[str] = FLAGS) -> bool | None:
        """Run what is in `folder`, changed or not, in both forms; None when it does not compile."""
        fates = []
        for form in FORMS.values():
            fates.append(self._survives(folder, [*flags, *form], None))
            if fates[-1] is False:
                return False
        # What does not compile in one form is not seen by the others.
        return None if None in fates else True

    def survives_image(self, folder: Path, image: Path) -> bool | None:
        """The same for an image, of which the form is no matter."""
        return self._survives(folder, FLAGS, image)

    def _survives(self, folder: Path, flags: Sequence[str], image: Path | None) -> bool | None:
        program = folder / "mutant"
        command = [
            GCC.find(), *flags, f"-I{folder}", "-o", str(program),
            str(self.harness), *(str(folder / self.work.named(f)) for f in (ROUTINE, CONSTANTS)),
        ]  # fmt: skip
        if run(command, folder).code:
            return None
        arguments = [program, self.vectors, self.answers, self.images, *([image] if image else [])]
        code = subprocess.run(arguments, capture_output=True, check=False).returncode
        if code == 2:
            raise BrokenToolError("the harness of the mutants was called wrongly")
        return code == 0

    def is_seen(self, folder: Path) -> bool:
        """Whether a change reaches this host's compiler: assembly for another core does not."""
        routine = self.work.named(ROUTINE)
        return any(
            _preprocessed(folder, form, routine) != _preprocessed(self.work.folder, form, routine)
            for form in FORMS.values()
        )


def _is_clean(folder: Path, routine: str) -> bool:
    """Whether the delivery would compile it: there every warning is an error."""
    return not any(
        run([GCC.find(), *DELIVERY_FLAGS, *form, "-c", "-o", "/dev/null", routine], folder).code
        for form in FORMS.values()
    )


def _preprocessed(folder: Path, form: Sequence[str], routine: str) -> str:
    return run([GCC.find(), "-E", "-P", *form, routine], folder).text


def c_campaign(bench: Bench, every: int = 1) -> list[Verdict]:
    """Mutants of triax_comp.c, each `every`-th."""
    source = (bench.work.folder / bench.work.named(ROUTINE)).read_text()
    return judge_all(bench, mutants_of(source)[::every], ROUTINE)


def constants_campaign(bench: Bench, every: int = 1) -> list[Verdict]:
    """Each integer of triax_calib.c one up and one down."""
    source = (bench.work.folder / bench.work.named(CONSTANTS)).read_text()
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
            fate = SURVIVED if bench.survives_image(folder, path) else KILLED
            verdicts.append(Verdict(mutant, fate))
    return verdicts


def judge_all(bench: Bench, mutants: Sequence[Mutant], file: str) -> list[Verdict]:
    """What becomes of mutants of one file, in their order."""
    equivalents = read_equivalents(names_of(bench.work.plan))

    def judge(item: tuple[int, Mutant]) -> Verdict:
        number, mutant = item
        folder = bench.work.folder / f"mutant_{file}_{number}"
        _fill(folder, bench.work)
        (folder / bench.work.named(file)).write_text(mutant.source)
        survives = bench.survives(folder)
        if survives is None:
            fate = STILLBORN
        elif not survives:
            fate = KILLED
        elif any(e.covers(mutant, bench.shape) for e in equivalents):
            fate = EQUIVALENT
        elif file == ROUTINE and not bench.is_seen(folder):
            fate = ELSEWHERE
        elif not bench.survives(folder, SANITIZED):
            fate = BY_SANITIZER
        elif file == ROUTINE and not _is_clean(folder, bench.work.named(ROUTINE)):
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
    for name in map(work.named, (ROUTINE, CONSTANTS, *HEADERS)):
        (folder / name).write_bytes((work.folder / name).read_bytes())


Campaign = Callable[[Bench, int], list[Verdict]]

CAMPAIGNS: Mapping[str, Campaign] = {
    "triax_comp.c": c_campaign,
    "triax_calib.c": constants_campaign,
    "triax_calib.bin": image_campaign,
}
"""What is mutated, and how."""

"""Frama-C WP: the portable C gives the integers of its specification, for every input.

The contracts stand in the C as comments; templates/verify/specification.h.j2 says what their words
mean. A function of values is proven with every definition at hand. A function that reads and writes
memory is proven with products, floors and polynomials left undefined: what it needs of them are
lemmas, and these are proven from the definitions. So no goal needs both kinds of reasoning.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.tools import TOOLS, MissingToolError, install_advice, missing_tools
from triaxcal.codegen.annotations import not_covered
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine, specification
from triaxcal.verify.outcome import NOT_DONE, Outcome, judged
from triaxcal.verify.tools import BrokenToolError, run
from triaxcal.verify.workspace import Workspace

KEY, TITLE = "wp", "WP: C = specification"
KNOWN = {"frama-c": "25.", "why3": "1.5.", "cvc4": "1.8", "z3": "4.8.12"}
"""Versions with which the proofs were made; another one may find fewer, or mean something else."""
GOAL_S = 30
OPTIONS = (
    "-machdep", "x86_32", "-warn-right-shift-negative", "-warn-signed-downcast", "-wp", "-wp-rte",
    "-wp-model", "Typed", "-wp-prover", "cvc4,z3", "-wp-par", "1",
)  # fmt: skip
OF_VALUES = ("s32", "high_word", "asr32", "magnitude", "times", "evaluate", "x_q31_of")
"""Functions proven with every definition."""
OF_MEMORY = (
    "horner_step", "evaluate_column", "evaluate_rows", "rounded", "clamp_raw", "apply_row",
    "apply_rows", "set_temperature",
)  # fmt: skip
WRAPPING = ("apply",)
"""Its test of the raw range subtracts modulo 2^32, as C defines."""
_LINE = re.compile(r"^\[wp\] \[(.+?)\] Goal (\w+)( : Valid.*)?", re.MULTILINE)
_COUNT = re.compile(r"Proved goals: +(\d+) / (\d+)")
_TIME = re.compile(r"\(([\d.]+m?s)\)")


@dataclass(frozen=True)
class Part:
    """One run of WP: functions, or the lemmas where there are none, and the specification."""

    functions: tuple[str, ...]
    specification: str
    options: tuple[str, ...] = ()


_LEMMAS = (
    Part((), "specification.h", ("-wp-prop=@lemma",)),
    Part((), "opaque.h", ("-wp-prop=row_bounded_of",)),
)


def check(work: Workspace) -> Outcome:
    """Prove every function from the Horner step to triax_apply; the loader has no contracts.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    if reason := not_covered(work.plan.shape):
        return Outcome(KEY, TITLE, NOT_DONE, f"not done for {reason}")
    versions = _versions()
    folder = work.folder / "wp"
    folder.mkdir(exist_ok=True)
    texts = _texts(work)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    known = _known(texts, versions)
    before = known.is_file()
    goals = json.loads(known.read_text(encoding="utf-8")) if before else _prove(work, folder)
    unproven = [name for name, goal in goals.items() if not goal["prover"]]
    if not before and not unproven:
        known.parent.mkdir(parents=True, exist_ok=True)
        partial = known.with_suffix(f".{os.getpid()}")
        partial.write_text(json.dumps(goals, indent=1, sort_keys=True), encoding="utf-8")
        partial.replace(known)
    counts = Counter(goal["function"] for goal in goals.values())
    finding = f"{len(goals) - len(unproven)} of {len(goals)} goals, every input; not the loader"
    if unproven:
        finding += f"; not proven: {unproven[0]}"
    figures: dict[str, Any] = {"versions": versions, "goals": dict(sorted(counts.items()))}
    return judged(KEY, TITLE, good=not unproven, finding=finding, figures=figures, details=unproven)


def _versions() -> dict[str, str]:
    """First line of what each program says about its version.

    Raises
    ------
    MissingToolError
        Where one is missing, or is not of a version that is known.
    """
    if missing := missing_tools(KNOWN):
        raise MissingToolError(f"{', '.join(missing)} not found; {install_advice(missing)}")
    found = {name: TOOLS[name].version() for name in KNOWN}
    for name, version in KNOWN.items():
        if not re.search(rf"(^|[ v]){re.escape(version)}", found[name]):
            raise MissingToolError(f"{name} {version} is known, found: {found[name] or 'none'}")
    return found


def _texts(work: Workspace) -> dict[str, str]:
    """Header and annotated C, and the specification with definitions and without."""
    plan = work.plan
    header = work.named("triax_comp.h")
    return {
        header: (work.folder / header).read_text(encoding="utf-8"),
        work.named("triax_comp.c"): annotated_routine(plan),
        "specification.h": specification(plan, opaque=False),
        "opaque.h": specification(plan, opaque=True),
    }


def _known(texts: dict[str, str], versions: dict[str, str]) -> Path:
    """Where the goals are kept that these texts gave to these programs."""
    content = json.dumps([texts, versions, OPTIONS, GOAL_S, OF_VALUES, OF_MEMORY, WRAPPING])
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    name = hashlib.sha256(content.encode()).hexdigest()
    return Path(home) / "triaxcal" / "wp" / f"{name}.json"


def _prove(work: Workspace, folder: Path) -> dict[str, dict[str, str]]:
    """Every goal, with its function, its prover (none where unproven) and the time it took."""
    config = {"WHY3CONFIG": str(folder / "why3.conf")}
    run(["why3", "config", "detect"], folder, config)
    linked = names_of(work.plan).linked
    file = work.named("triax_comp.c")
    text = (folder / file).read_text(encoding="utf-8")
    present = [name.removeprefix(f"{linked}_") for name in _functions(text, linked)]
    goals: dict[str, dict[str, str]] = {}
    for part in _parts(present):
        goals |= _run(folder, file, part, linked, config)
    return goals


def _functions(text: str, linked: str) -> list[str]:
    """Functions of the C that have a contract, by their link names."""
    heads = re.findall(r"\*/\n(?:static )?u?int\d+_t (\w+)\(|\*/\nstatic void (\w+)\(", text)
    triad = linked.rpartition("_")[0]
    return [
        name.replace(f"{triad}_", f"{linked}_", 1) if name.startswith(f"{triad}_") else name
        for name in (a or b for a, b in heads)
    ]


def _parts(present: Sequence[str]) -> list[Part]:
    def of(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(p for p in present if re.sub(r"_\d+$", "", p) in names)

    no_wrap = ("-warn-unsigned-overflow",)
    functions = ("-wp-prop=-@lemma",)
    parts = [
        *_LEMMAS,
        Part(of(OF_VALUES), "specification.h", no_wrap + functions),
        Part(of(OF_MEMORY), "opaque.h", no_wrap + functions),
        Part(of(WRAPPING), "opaque.h", functions),
    ]
    return [part for part in parts if part.functions or part in _LEMMAS]


def _run(
    folder: Path, file: str, part: Part, linked: str, config: dict[str, str]
) -> dict[str, dict[str, str]]:
    exported = ("set_temperature", "apply")
    names = [f"{linked}_{name}" if name in exported else name for name in part.functions]
    chosen = ("-wp-fct", ",".join(names)) if names else ()
    command = [
        TOOLS["frama-c"].find(), *OPTIONS, "-wp-timeout", str(GOAL_S), *part.options, *chosen,
        f"-cpp-extra-args=-include {part.specification}", file,
    ]  # fmt: skip
    answer = run(command, folder, config)
    counted = _COUNT.search(answer.text)
    if answer.code or counted is None:
        raise BrokenToolError(f"frama-c: {' '.join(answer.text.split())[-300:]}")
    goals = {}
    for prover, goal, valid in _LINE.findall(answer.text):
        function = max((n for n in names if f"_{n}_" in f"{goal}_"), key=len, default="lemmas")
        time = _TIME.findall(valid)
        goals[goal.removeprefix("typed_")] = {
            "function": function.removeprefix(f"{linked}_"),
            "prover": prover if valid else "",
            "time": time[-1] if time else "",
        }
    proven = sum(bool(goal["prover"]) for goal in goals.values())
    if (proven, len(goals)) != tuple(map(int, counted.groups())):
        raise BrokenToolError(f"frama-c: {counted[0]}, but {proven} of {len(goals)} reported")
    return goals

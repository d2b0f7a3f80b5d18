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
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triaxcal.base.tools import TOOLS, MissingToolError, install_advice, missing_tools
from triaxcal.codegen.annotations import loader_not_covered, not_covered
from triaxcal.codegen.names import names_of
from triaxcal.codegen.render import annotated_routine, render_routine, specification
from triaxcal.fixedpoint.shape import Shape
from triaxcal.verify.outcome import FAILED, NOT_DONE, Outcome, judged
from triaxcal.verify.tools import BrokenToolError, run, run_until
from triaxcal.verify.workspace import ROUTINE, Workspace
from triaxcal.verify.wp_texts import contracts_of, overlooked, unexpected_warning, without_goal

KEY, TITLE = "wp", "WP: C = specification"
KNOWN = {"frama-c": "25.", "why3": "1.5.", "cvc4": "1.8", "z3": "4.8.12"}
"""Versions with which the proofs were made; another one may find fewer, or mean something else."""
GOAL_S = 60
"""The slowest goal takes a tenth of it on a machine that does nothing else."""
SMOKE_S = 1
"""Time of a smoke test with each prover. A contradiction needs less; all else takes it all."""
AT_ONCE = 2
"""Runs of WP beside each other."""
A_RUN = 3
"""Functions of a run. The runs then end together, each well within the time limit of a tool."""
OPTIONS = (
    "-machdep", "x86_32", "-warn-right-shift-negative", "-warn-signed-downcast", "-wp", "-wp-rte",
    "-wp-model", "Typed", "-wp-prover", "cvc4,z3", "-wp-par", "1",
)  # fmt: skip
OF_VALUES = (
    "s32", "high_word", "asr32", "asr64", "saturate32", "with_saturated", "magnitude", "times",
    "evaluate", "x_q31_of", "rate_q31_of", "above_min", "beyond_range", "out_of_range",
    "copy_rows", "nearest_raw", "clamp_raw", "cofactor", "reciprocal", "element", "offset_of",
    "word_at", "crc32", "horner_bound", "x_fits", "rate_fits", "reach_of",
)  # fmt: skip
"""Functions proven with every definition."""
OF_MEMORY = (
    "horner_step", "evaluate_column", "evaluate_rows", "rounded", "apply_row",
    "apply_rows", "set_temperature", "apply", "sensitivity_sum", "copy_terms", "products_of",
    "quadratic_sum",
    "rate_offset_of", "add_rate", "set_temperature_rate",
    "cofactor_at", "adjugate_of", "determinant_of", "invert_row", "invert", "clear_rows",
    "invert_at",
)  # fmt: skip
"""Functions proven with what lemmas say of the definitions."""
OF_LOADER = (
    "int_at", "segment_fits", "terms_fit", "read_function", "read_segment", "constants_fit",
    "identity_fits", "image_fits", "read_terms", "read_rate",
    "read_calib", "calib_check", "calib_load",
)  # fmt: skip
"""The same for what reads memory in the loader."""
SMOKE = "_wp_smoke_"
"""Name of a goal that asks whether anything follows from nothing: WP must not prove it."""
Goals = Mapping[str, Mapping[str, str]]
"""Goals by name: function, prover and time of each."""
_LEMMA = re.compile(r"lemma (\w+)")
_LINE = re.compile(r"^\[wp\] \[(.+?)\] Goal (\w+)( : Valid.*)?", re.MULTILINE)
_SMOKE = re.compile(r"^\[wp\] \[(\w+)\] Smoke-test typed_(\w+)", re.MULTILINE)
_COUNT = re.compile(r"Proved goals: +(\d+) / (\d+)")
_TIME = re.compile(r"\(([\d.]+m?s)\)")


@dataclass(frozen=True)
class Part:
    """One run of WP: functions or lemmas, and the specification."""

    functions: tuple[str, ...]
    specification: str
    options: tuple[str, ...] = ()
    lemmas: tuple[str, ...] = ()


@dataclass(frozen=True)
class Place:
    """Folder and C file that WP reads, what its link names begin with, and the provers' setting."""

    folder: Path
    file: str
    linked: str
    config: Mapping[str, str]


def check(work: Workspace) -> Outcome:
    """Prove every function; the loader too, where it has contracts.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    if reason := not_covered(work.plan.shape):
        return Outcome(KEY, TITLE, NOT_DONE, f"not done for {reason}")
    found = versions()
    file = work.named(ROUTINE)
    if (work.folder / file).read_text(encoding="utf-8") != render_routine(work.plan)[file]:
        finding = f"{file} is not the routine of this shape: nothing is proven of it"
        return Outcome(KEY, TITLE, FAILED, finding)
    folder = work.folder / "wp"
    texts = write_texts(work, folder)
    if doubts := overlooked(
        texts[file],
        names_of(work.plan).triad,
        texts["specification.h"],
        texts["opaque.h"],
        loader=not loader_not_covered(work.plan.shape),
    ):
        raise BrokenToolError(f"contracts: {doubts[0]}")
    return outcome_of(
        texts,
        found,
        lambda: _prove(work, folder, texts),
        not_loader=loader_not_covered(work.plan.shape),
        unreached_of=lambda goals: _unreached(work.plan.shape, goals),
    )


def outcome_of(
    texts: Mapping[str, str],
    found: Mapping[str, str],
    prove: Callable[[], Goals],
    *,
    not_loader: str = "",
    unreached_of: Callable[[Goals], list[str]] = lambda _: [],
) -> Outcome:
    """Outcome of the goals of texts, which are proven unless they are known.

    Parameters
    ----------
    texts, found : dict
        What WP reads, and the versions of the programs.
    prove : function
        Gives each goal with its function, its prover (none where unproven) and the time it took.
    not_loader : str
        Why the loader has no contracts, where it has none.
    unreached_of : function
        Which failed smoke tests of goals are no failure.
    """
    known = _known(texts, found)
    kept = _kept(known)
    before = bool(kept)
    goals = kept or prove()
    unreached = unreached_of(goals)
    unproven = [n for n, goal in goals.items() if not goal["prover"] and n not in unreached]
    if not before and not unproven:
        known.parent.mkdir(parents=True, exist_ok=True)
        partial = known.with_suffix(f".{os.getpid()}")
        partial.write_text(json.dumps(goals, indent=1, sort_keys=True), encoding="utf-8")
        partial.replace(known)
    smoke = {name for name in goals if SMOKE in name}
    counts = Counter(goal["function"] for name, goal in goals.items() if name not in smoke)
    left = {*unproven, *unreached}
    proven, passed = (set(names) - left for names in (goals.keys() - smoke, smoke))
    finding = (
        f"{len(proven)} of {counts.total()} goals, every input; "
        f"{len(passed)} of {len(smoke)} smoke tests"
    )
    if unreached:
        finding += f", {len(unreached)} where nothing needs to be saturated"
    if not_loader:
        finding += f"; not the loader: {not_loader}"
    if unproven:
        finding += f"; not proven: {unproven[0]}"
    figures: dict[str, Any] = {
        "versions": dict(found),
        "goals": dict(sorted(counts.items())),
        "smoke_tests": len(smoke),
    }
    return judged(KEY, TITLE, good=not unproven, finding=finding, figures=figures, details=unproven)


def _unreached(shape: Shape, goals: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Failed smoke tests of places of `apply` that no input reaches.

    With a shift of 32 bits, step R keeps every sum within int32: what an axis does with a saturated
    result is not reached. A contradiction fails the tests of contracts as well.
    """
    within = shape.output_shift == 32 and not shape.quadratic
    found = [
        name
        for name, goal in goals.items()
        if f"{SMOKE}dead_code" in name and goal["function"] == "apply" and not goal["prover"]
    ]
    return found if within and len(found) <= 3 else []


def versions() -> dict[str, str]:
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


def write_texts(work: Workspace, folder: Path) -> dict[str, str]:
    """Write header, annotated C and both forms of the specification; return them by name."""
    plan = work.plan
    header = work.named("triax_comp.h")
    texts = {
        header: (work.folder / header).read_text(encoding="utf-8"),
        work.named("triax_comp.c"): annotated_routine(plan),
        "specification.h": specification(plan, opaque=False),
        "opaque.h": specification(plan, opaque=True),
    }
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return texts


def prepared(work: Workspace, folder: Path) -> Place:
    """The folder of a triad's texts with what Why3 needs to find the provers."""
    return place_in(folder, work.named("triax_comp.c"), names_of(work.plan).linked)


def place_in(folder: Path, file: str, linked: str) -> Place:
    """The same of any C file."""
    config = {"WHY3CONFIG": str(folder / "why3.conf")}
    run(["why3", "config", "detect"], folder, config)
    return Place(folder, file, linked, config)


def _kept(known: Path) -> Goals:
    """Proven goals of a run before; none where there is no such file, or it is not whole."""
    try:
        found = json.loads(known.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    whole = isinstance(found, dict) and all(
        isinstance(goal, dict) and goal.keys() >= {"function", "prover", "time"}
        for goal in found.values()
    )
    return found if whole else {}


def _known(texts: Mapping[str, str], versions: Mapping[str, str]) -> Path:
    """Where the goals are kept that these texts gave to these programs, run by this code."""
    here = Path(__file__)
    runner = [
        p.read_text(encoding="utf-8")
        for p in (here, here.with_name("wp_texts.py"), here.with_name("wp_imu.py"))
    ]
    content = json.dumps(
        [
            dict(texts),
            dict(versions),
            OPTIONS,
            GOAL_S,
            SMOKE_S,
            OF_VALUES,
            OF_MEMORY,
            OF_LOADER,
            runner,
        ]
    )
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    name = hashlib.sha256(content.encode()).hexdigest()
    return Path(home) / "triaxcal" / "wp" / f"{name}.json"


def _prove(work: Workspace, folder: Path, texts: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Every goal, with its function, its prover (none where unproven) and the time it took."""
    place = prepared(work, folder)
    present = functions_of(texts[place.file], place.linked)
    # The longest first, so that none is left alone at the end.
    parts = [*lemmas_of(texts), *reversed(parts_of(present))]
    goals: dict[str, dict[str, str]] = {}
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for found in pool.map(lambda part: goals_of(place, part), parts):
            goals |= found
    return goals


def lemmas_of(texts: Mapping[str, str]) -> list[Part]:
    """Runs that prove the lemmas of both specifications.

    Those of specification.h from the definitions; those that opaque.h has alone from the others.
    """
    known, opaque = (_LEMMA.findall(texts[name]) for name in ("specification.h", "opaque.h"))
    following = [name for name in opaque if name not in known]
    parts = [Part((), "specification.h", ("-wp-prop=@lemma",), tuple(known))]
    if following:
        option = f"-wp-prop={','.join(following)}"
        parts.append(Part((), "opaque.h", (option,), tuple(following)))
    return parts


def functions_of(text: str, linked: str) -> list[str]:
    """Functions of the C that have a contract; exported ones without the triad's name."""
    contracts = contracts_of(text, linked.rpartition("_")[0])
    return [name for name, contract in contracts.items() if contract]


def parts_of(present: Sequence[str]) -> list[Part]:
    """Runs that prove functions of the C.

    Raises
    ------
    ValueError
        Where one of them is in no group.
    """

    def of(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(p for p in present if re.sub(r"_\d+$", "", p) in names)

    options = ("-warn-unsigned-overflow", "-wp-prop=-@lemma")
    groups = (
        (of(OF_VALUES), "specification.h"),
        (of(OF_MEMORY), "opaque.h"),
        (of(OF_LOADER), "opaque.h"),
    )
    parts = [
        Part(names[i : i + A_RUN], specification, options)
        for names, specification in groups
        for i in range(0, len(names), A_RUN)
    ]
    grouped = [name for part in parts for name in part.functions]
    if sorted(grouped) != sorted(present):
        raise ValueError(f"contracts of {present}, groups for {grouped}")
    return parts


def _command(place: Place, part: Part, limit_s: int) -> tuple[list[str], list[str]]:
    """What runs a part, and the link names of its functions."""
    linked = place.linked
    exported = ("set_temperature", "set_temperature_rate", "apply", "calib_check", "calib_load")
    names = [f"{linked}_{name}" if name in exported else name for name in part.functions]
    chosen = ("-wp-fct", ",".join(names)) if names else ()
    command = [
        TOOLS["frama-c"].find(), *OPTIONS, "-wp-timeout", str(limit_s), *part.options, *chosen,
        f"-cpp-extra-args=-include {part.specification}{' -DLEMMAS' if part.lemmas else ''}",
        place.file,
    ]  # fmt: skip
    return command, names


def goals_of(place: Place, part: Part) -> dict[str, dict[str, str]]:
    """Every goal of a part, with function, prover (none where unproven) and time.

    Raises
    ------
    BrokenToolError
    """
    command, names = _command(place, part, GOAL_S)
    if names:
        command[-1:-1] = ["-wp-smoke-tests", "-wp-smoke-timeout", str(SMOKE_S)]
    answer = run(command, place.folder, place.config)
    counted = _COUNT.search(answer.text)
    if answer.code or counted is None:
        raise BrokenToolError(f"frama-c: {' '.join(answer.text.split())[-300:]}")
    goals = {}
    for prover, goal, valid in _LINE.findall(answer.text):
        time = _TIME.findall(valid)
        goals[goal.removeprefix("typed_")] = {
            "function": _function(goal, place.linked, names),
            "prover": prover if valid else "",
            "time": time[-1] if time else "",
        }
    for result, test in _SMOKE.findall(answer.text):
        passed = "no contradiction" if result == "Passed" else ""
        function = _function(test, place.linked, names)
        goals[test] = {"function": function, "prover": passed, "time": ""}
    if missing := _without_goal(place, part, names, goals):
        raise BrokenToolError(f"frama-c: not every goal of {', '.join(missing)}")
    if warning := unexpected_warning(answer.text, of_lemmas=not names):
        raise BrokenToolError(f"frama-c warns: {warning}")
    proven = sum(bool(goal["prover"]) for goal in goals.values())
    if (proven, len(goals)) != tuple(map(int, counted.groups())):
        raise BrokenToolError(f"frama-c: {counted[0]}, but {proven} of {len(goals)} reported")
    return goals


def _without_goal(
    place: Place, part: Part, names: Sequence[str], goals: Mapping[str, Mapping[str, str]]
) -> list[str]:
    """Functions, with their link names, or lemmas of a part that WP made too few goals of."""
    text = (place.folder / place.file).read_text(encoding="utf-8")
    contracts = contracts_of(text, place.linked.rpartition("_")[0])
    asked_of = {n: contracts[f] for n, f in zip(names, part.functions, strict=True)}
    lemmas = [name for name in part.lemmas if f"lemma_{name}" not in goals]
    return [*without_goal(goals, asked_of), *lemmas]


def _function(goal: str, linked: str, names: Sequence[str]) -> str:
    function = max((n for n in names if f"_{n}_" in f"_{goal}_"), key=len, default="lemmas")
    return function.removeprefix(f"{linked}_")


def is_proven(place: Place, part: Part, limit_s: int) -> bool | None:
    """Whether every goal of a part is proven; the first that is not ends the run.

    None where Frama-C does not accept the C.

    Raises
    ------
    BrokenToolError
    """
    command, _ = _command(place, part, limit_s)
    answer = run_until(_is_open_goal, command, place.folder, place.config)
    if answer is None:
        return False
    counted = _COUNT.search(answer.text)
    if counted is None:
        return None
    proven, goals = map(int, counted.groups())
    if answer.code or not goals or proven != goals:
        raise BrokenToolError(f"frama-c: {' '.join(answer.text.split())[-300:]}")
    return True


def _is_open_goal(line: str) -> bool:
    found = _LINE.match(line)
    return found is not None and not found[3]

"""Frama-C WP: triax_imu.c gives what both triads give, one after the other, for every input.

It calls functions whose contracts are proven for each triad. Here these contracts are taken as they
are, from the text that is proven, and only the names of their words are made different: both triads
have a `state_fits`, so that of the accelerometer is `accel_state_fits`. No lemma is taken: what is
needed is that words which are not written still mean the same, and that is proven from definitions.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from pathlib import Path

from triaxcal.codegen.annotations import imu_loader_not_covered, imu_not_covered
from triaxcal.codegen.imu import ImuBuild, annotated_imu, delivered_imu
from triaxcal.codegen.names import imu_context, names_of
from triaxcal.codegen.render import TERM_TABLES, annotated_routine, render_routine, specification
from triaxcal.codegen.templates import environment
from triaxcal.fixedpoint.plan import Plan
from triaxcal.verify import wp
from triaxcal.verify.outcome import FAILED, NOT_DONE, Outcome
from triaxcal.verify.tools import BrokenToolError
from triaxcal.verify.wp_texts import overlooked, statements_of

TEMPLATE = "verify/specification_imu.h.j2"
CALLED = ("set_temperature", "apply", "calib_check", "calib_load")
"""Functions of a triad that triax_imu.c calls, those of the loader last."""
READ = {
    "result": "r[0 .. 3]",
    "exact": "r[0 .. 3]",
    "state_fits": "r[0 .. 2][0 .. 3]",
    "rows_are_zero": "r[0 .. 2][0 .. 3]",
    "calib_fits": "*c",
    "code_invertible": "*c",
    "state_is": r"\at(*t, P), \at(*c, L)",
    "terms_are": r"\at(*t, P), \at(*c, L)",
    "calib_is": r"\at(*c, P), \at(image[0 ..], L)",
    "same_calib": r"\at(*c, P), \at(*c, Q)",
    "accepted": "image[0 .. size - 1]",
}
"""Words that the proofs about functions leave undefined, and what they read."""
UNDEFINED = ("mag",)
"""Words of numbers that no proof here needs to know."""
_USED = re.compile(r"(?<![\\\w.>])([a-z]\w*)(?=[({])")
_FUNCTION = re.compile(r"^(/\*@(?:[^*]|\*(?!/))*\*/\n)(uint32_t (\w+)\([^{;]*\))\n\{", re.MULTILINE)


def check(folder: Path, build: ImuBuild) -> Outcome:
    """Prove every function of triax_imu.c; `folder` has the delivered files.

    Raises
    ------
    MissingToolError, BrokenToolError
    """
    accel, gyro, apart = build.accel, build.gyro, build.two_thermometers
    shapes = accel.shape, gyro.shape
    if reason := imu_not_covered(*shapes):
        return Outcome(wp.KEY, wp.TITLE, NOT_DONE, f"not done for {reason}")
    found = wp.versions()
    file = names_of(accel).file("triax_imu.c")
    delivered = delivered_imu(accel, gyro, two_thermometers=apart)
    if (folder / file).read_text(encoding="utf-8") != delivered[file]:
        finding = f"{file} is not the one for these shapes: nothing is proven of it"
        return Outcome(wp.KEY, wp.TITLE, FAILED, finding)
    texts = write_texts(folder / "wp", accel, gyro, two_thermometers=apart)
    place = place_of(folder / "wp", accel, gyro, two_thermometers=apart)
    reason = imu_loader_not_covered(*shapes)
    if doubts := overlooked(
        texts[file],
        place.linked.rpartition("_")[0],
        texts["specification.h"],
        texts["opaque.h"],
        loader=not reason,
    ):
        raise BrokenToolError(f"contracts: {doubts[0]}")
    return wp.outcome_of(texts, found, lambda: _prove(place, texts), not_loader=reason)


def write_texts(
    folder: Path, accel: Plan, gyro: Plan, *, two_thermometers: bool = False
) -> dict[str, str]:
    """Write headers, annotated C and both forms of the specification; return them by name."""
    plans = accel, gyro
    texts = delivered_imu(accel, gyro, two_thermometers=two_thermometers)
    for plan in plans:
        header = names_of(plan).file("triax_comp.h")
        texts[header] = render_routine(plan)[header]
    texts |= annotated_imu(accel, gyro, two_thermometers=two_thermometers)
    if imu_loader_not_covered(accel.shape, gyro.shape):
        # What it calls has no contract here, so Frama-C would assume one.
        file = names_of(accel).file("triax_imu.c")
        loader = texts[file].index(f"uint32_t {names_of(accel).triad}_imu_calib_load(")
        texts[file] = texts[file][:loader]
    texts["specification.h"] = imu_specification(accel, gyro, opaque=False)
    texts["opaque.h"] = imu_specification(accel, gyro, opaque=True)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return texts


def place_of(folder: Path, accel: Plan, gyro: Plan, *, two_thermometers: bool = False) -> wp.Place:
    """Where WP finds triax_imu.c, and the provers."""
    linked = imu_context(accel, gyro, two_thermometers=two_thermometers)["imu_linked"]
    return wp.place_in(folder, names_of(accel).file("triax_imu.c"), linked)


def parts_of(place: wp.Place, texts: Mapping[str, str]) -> list[wp.Part]:
    """Runs that prove the lemmas, and the functions that have contracts."""
    options = ("-warn-unsigned-overflow", "-wp-prop=-@lemma")
    functions = tuple(wp.functions_of(texts[place.file], place.linked))
    return [*wp.lemmas_of(texts), wp.Part(functions, "opaque.h", options)]


def _prove(place: wp.Place, texts: Mapping[str, str]) -> dict[str, dict[str, str]]:
    goals: dict[str, dict[str, str]] = {}
    for part in parts_of(place, texts):
        goals |= wp.goals_of(place, part)
    return goals


def imu_specification(accel: Plan, gyro: Plan, *, opaque: bool) -> str:
    """What the contracts of triax_imu.c mean, with those of the functions that it calls.

    Parameters
    ----------
    opaque : bool
        Without the definitions of `READ`; the lemmas about them stay.
    """
    loader = not imu_loader_not_covered(accel.shape, gyro.shape)
    triads = {
        name: {
            "word": word_of(plan),
            "shape": plan.shape,
            "triad": names_of(plan).triad,
            "terms": TERM_TABLES[plan.shape.gyro],
            "interface": interface(plan, loader=loader, opaque=opaque),
        }
        for name, plan in (("accel", accel), ("gyro", gyro))
    }
    context = {**names_of(accel).context, **triads, "loader": loader, "opaque": opaque}
    file = names_of(accel).file("triax_imu.c")
    return environment().get_template(TEMPLATE).render(file=file, **context)


def word_of(plan: Plan) -> str:
    """What the words of a triad's specification begin with where there are two."""
    return "gyro_" if plan.shape.gyro else "accel_"


def interface(plan: Plan, *, loader: bool, opaque: bool) -> str:
    """Contracts of the functions of a triad that are called, and the words that they use."""
    contracts = contracts_called(plan, loader=loader)
    words = words_used(plan, contracts, opaque=opaque)
    statements = "".join(f"  {text};\n" for text in words.values())
    block = f"/*@ axiomatic {word_of(plan)}words {{\n{statements}}} */\n"
    return renamed("\n".join((block, *contracts)), words, word_of(plan))


def contracts_called(plan: Plan, *, loader: bool) -> list[str]:
    """Contract and declaration of each function that is called, as they stand in the C."""
    triad = names_of(plan).triad
    found = {
        name.removeprefix(f"{triad}_"): f"{contract}{head};\n"
        for contract, head, name in _FUNCTION.findall(annotated_routine(plan))
    }
    return [found[name] for name in CALLED[: None if loader else 2]]


def words_used(plan: Plan, contracts: Collection[str], *, opaque: bool) -> dict[str, str]:
    """Statements of the specification that contracts use, with all that these use.

    Words of numbers alone, and of images, stay undefined: a caller has nothing to compute.
    """
    known, hidden = (statements_of(specification(plan, opaque=flag)) for flag in (False, True))
    words = {}
    for name, text in hidden.items():
        if text.startswith("lemma"):
            continue
        of_memory = " reads " in text and "int32_t *" in text
        words[name] = known[name] if of_memory else text
        head = text.split(" = ")[0]
        if name in UNDEFINED:
            words[name] = head
        elif opaque and (places := _read(plan, name)):
            words[name] = f"{head} reads {places}"
    needed: set[str] = set()
    new = set(_USED.findall("\n".join(contracts))) & words.keys()
    while new:
        needed |= new
        new = {used for name in new for used in _USED.findall(words[name])} & words.keys() - needed
    return {name: text for name, text in words.items() if name in needed}


def _read(plan: Plan, name: str) -> str:
    """What a word reads that stays undefined in the proofs about functions; "" for others."""
    quadratic = plan.shape.quadratic
    own = {
        "terms_fit": f"k[0 .. 2][0 .. {5 if quadratic else 2}]",
        "added": "q[0 .. 5], t->row[0 .. 2][0 .. 3]" if quadratic else "k[0 .. 2]",
    }
    return {**READ, **own}.get(name, "")


def renamed(text: str, names: Collection[str], word: str) -> str:
    """A text with a word before each of some names."""
    alternatives = "|".join(sorted(names))
    return re.sub(rf"(?<![\\\w.>])({alternatives})(?=[({{])", lambda found: word + found[1], text)

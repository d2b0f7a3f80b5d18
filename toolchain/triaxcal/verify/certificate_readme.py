"""README.txt beside the theorems of an error bound: what they say and how to check them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from triaxcal.verify.outcome import Outcome


def certificate_readme(unit: str, groups: Mapping[str, Sequence[Outcome]]) -> bytes:
    """Text for whoever gets the folder and has no triaxcal."""
    lines = [
        f"Error bound of the fixed-point C of unit {unit}, as theorems for Coq.",
        "",
        "Check them yourself; nothing of triaxcal is needed:",
        "",
        "    sudo apt-get install coq libcoq-gappa libcoq-flocq",
        "    for file in *.v; do coqc -q $file || echo REFUSED $file; done",
        "",
        "Coq prints the theorem and the axioms that it rests upon: those of the classical real",
        "numbers in Coq's own library, and no other. A refused file prints an error.",
        "",
        "Each file says, of one axis and one segment of the temperature: for every temperature of",
        "the segment and every raw code, the integers that the device computes differ from the",
        "fitted functions by no more than the two numbers at the end of the file, in output LSB.",
        "The words in it are those of triax_calib.bin.",
        "",
    ]
    for name, outcomes in groups.items():
        for outcome in outcomes:
            lines.append(f"{name + ': ' if name else ''}{outcome.finding}")
            lines += [f"  {digest}  {file}" for file, digest in outcome.figures["sha256"].items()]
    return ("\n".join(lines) + "\n").encode()

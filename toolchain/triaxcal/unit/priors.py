"""[priors] and [firmware] of unit.toml: what is known of every sensor of a type beforehand."""

from __future__ import annotations

from dataclasses import dataclass, replace

from triaxcal.base.keys import TableKeys, keys_of, setting
from triaxcal.base.kinds import number, word
from triaxcal.unit.angles import AngleKeys
from triaxcal.unit.arithmetic import ARITHMETIC, PORTABLE
from triaxcal.unit.prefix import DEFAULT_PREFIX, PREFIX

AUTO, LINEAR, OWN_SQUARES, QUADRATIC_TERMS = "auto", "linear", "own-squares", "quadratic"
FIRMWARE_TERMS = (AUTO, LINEAR, OWN_SQUARES, QUADRATIC_TERMS)


@dataclass(frozen=True)
class Priors:
    """[priors]: what is known of the constants before any reading.

    Each is the standard deviation of a normal distribution about zero: of every sensor of this
    type, how far its constants stray from the ideal.

    Attributes
    ----------
    cross_term_rad
        Standard deviation of each cross term of K, of its scale factor: misalignment.
    scale_factor
        Of each scale factor against the mean of the three, relative: 0.02 is 2 %.
    own_square_g_per_g2
        Of the square of an axis' own acceleration in its output, K2.
    product_g_per_g2
        Of each other product of two accelerations in an output.
    bias_g
        Of each bias against the reading of 0 g.
    mean_scale
        Of the mean of the scale factors against the nominal one, where it is known, relative.
    """

    cross_term_rad: float = setting(number(1e-7, 1.0), 0.010, "rad")
    scale_factor: float = setting(number(1e-7, 1.0), 0.02)
    own_square_g_per_g2: float = setting(number(1e-9, 1.0), 0.005, "g/g^2")
    product_g_per_g2: float = setting(number(1e-9, 1.0), 3e-4, "g/g^2")
    bias_g: float = setting(number(1e-6, 100.0), 0.1, "g")
    mean_scale: float = setting(number(1e-6, 10.0), 0.1)


@dataclass(frozen=True)
class FirmwareChoice:
    """[firmware]: which routine the firmware runs.

    Attributes
    ----------
    terms
        Terms beyond the twelve constants in the C. auto: of a recording of poses, those that make
        the poses 10 times as probable and whose largest effect at T0 and 1 g is above its standard
        uncertainty; on a tilter, own squares that matter and that held-out readings confirm.
        linear: none. own-squares: the square of each axis' own acceleration. quadratic: all
        products; not on a tilter. State it so that all units of a series run one routine.
    prefix
        What the names of functions, types, macros and files in the C begin with. Give each sensor
        of a program its own.
    arithmetic
        How the C forms its products. limbs, thumb2 and thumb1 give a second file, as
        triax_comp_thumb2.c, which is compiled in place of triax_comp.c and gives the same bits.
        limbs: 32-bit products of halves. thumb2: assembly for Cortex-M3, M4, M7, M33. thumb1:
        assembly for Cortex-M0, M0+, M1. high-words: for RISC-V with multiplication (RV32IM). It
        changes triax_comp.c and the constants: fewer instructions, and a larger error. It is
        taken where that error keeps the share of model_error_max_micro_g; else it is portable.
    """

    terms: str = setting(word(FIRMWARE_TERMS), AUTO)
    prefix: str = setting(PREFIX, DEFAULT_PREFIX)
    arithmetic: str = setting(ARITHMETIC, PORTABLE)


_TERMS, _PREFIX, _ARITHMETIC = keys_of(FirmwareChoice)
PRIORS = TableKeys.of(Priors)
FIRMWARE = replace(
    TableKeys.of(FirmwareChoice), keys=(_TERMS, _PREFIX, *keys_of(AngleKeys), _ARITHMETIC)
)

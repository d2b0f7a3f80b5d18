"""What a calibration from a recording knows beyond the twelve constants."""

from __future__ import annotations

import math
from dataclasses import dataclass

from triaxcal.fitting.core.judged import TEMPERATURE, HeldOutPoses
from triaxcal.model.types import FloatArray
from triaxcal.poses.poseset import PoseSet


@dataclass(frozen=True)
class PairTerms:
    """Cross-coupling that a pair on a dividing head has shown, and how well.

    Attributes
    ----------
    quadratic : array, shape (3, 6)
        Q in g/g^2.
    covariance : array, shape (18, 18)
        Of Q row by row.
    dof : int
        Degrees of freedom of the pair's residuals.
    findings : tuple of str
        What the user should know about it.
    """

    quadratic: FloatArray
    covariance: FloatArray
    dof: int
    findings: tuple[str, ...]


@dataclass(frozen=True)
class TermsCovariance:
    """How well the poses determine the terms beyond the twelve constants.

    Attributes
    ----------
    quadratic : array, shape (18, 18), or None
        Of Q row by row, g/g^2; None without quadratic terms.
    cross : array, shape (12, P, 18), or None
        Of the constants' parameters with Q.
    rate_g2 : array, shape (3, 3), or None
        Of the offset at the largest dT/dt; None without a term in it.
    """

    quadratic: FloatArray | None = None
    cross: FloatArray | None = None
    rate_g2: FloatArray | None = None


NO_TERMS_COVARIANCE = TermsCovariance()


NOISE_PART, PRIOR_PART, LEFT_OUT_PART = "noise", "priors", "left out"


@dataclass(frozen=True)
class CovariancePart:
    """A part of the covariance about the delivered constants, of errors independent of the others.

    Attributes
    ----------
    key : str
        `NOISE_PART`: the scatter of the poses; `PRIOR_PART`: what is left of the priors;
        `LEFT_OUT_PART`: terms that the C does not compute.
    covariance : array, shape (12, P, 12, P)
    terms : TermsCovariance
    """

    key: str
    covariance: FloatArray
    terms: TermsCovariance


@dataclass(frozen=True)
class ConstantShare:
    """One constant at T0, and how much the poses and how much the prior determine it.

    Attributes
    ----------
    name, unit : str
    value, sd : float
        Of the fit that knows all terms, in the sensor's frame.
    prior_sd : float
    data : float
        Share of the poses, 0 to 1: 1 - variance / variance of the prior.
    """

    name: str
    unit: str
    value: float
    sd: float
    prior_sd: float
    data: float


@dataclass(frozen=True)
class RecordingFit:
    """The poses behind a calibration, and how well they determine it.

    Attributes
    ----------
    poses : PoseSet
    route : str
        What was known of the poses, in words.
    covariance : array, shape (12, P, 12, P)
        Of the constants' parameters, in the order of `CONSTANT_NAMES`.
        NaN without any degree of freedom.
    dof : float
        Degrees of freedom with which the noise is known; 0 in a file of an earlier version where
        there are as many constants as poses.
    rms_g, rms_free_g : float
        Rms of |a| - g (of its components, where angles are known) at the fitted poses, and the
        same per degree of freedom; the latter NaN without any.
    held_out_g : float or None
        The same at what was held out in turn: the score of the candidates.
    left_out_length_g : float or None
        Rms of |a| - g over the poses, each held out with its orientation (of more than 60
        orientations in 60 groups); temperatures and half-cycles held out are not in it.
    condition : float
        Condition number of the scaled Jacobian.
    weakest : str
        The constants that the poses see least.
    residual_g : array, shape (poses,)
        |a| - g at each pose.
    findings : tuple of str
        What the user should know, the worst first.
    terms : TermsCovariance
    parts : tuple of CovariancePart
        Their sum is `covariance` and `terms`; empty where the fit has no priors.
    noise_95_g : float
        Half the 95 % interval of the noise of a pose; 1.96 of its standard deviation and more, as
        far as that is unknown. NaN without priors.
    expected_g : float or None
        Rms error that the fit expects of what is held out, its noise included.
    held_out_poses : int
        Of how many poses `left_out_length_g` is.
    contradicted : tuple of str
        Those of `findings` that name standard deviations of [priors] which the poses contradict.
    shares : tuple of ConstantShare
    held_out : tuple of HeldOutPoses
        Errors of orientations and of temperatures held out.
    """

    poses: PoseSet
    route: str
    covariance: FloatArray
    dof: float
    rms_g: float
    rms_free_g: float
    held_out_g: float | None
    left_out_length_g: float | None
    condition: float
    weakest: str
    residual_g: FloatArray
    findings: tuple[str, ...]
    terms: TermsCovariance = NO_TERMS_COVARIANCE
    parts: tuple[CovariancePart, ...] = ()
    noise_95_g: float = math.nan
    expected_g: float | None = None
    held_out_poses: int = 0
    contradicted: tuple[str, ...] = ()
    shares: tuple[ConstantShare, ...] = ()
    held_out: tuple[HeldOutPoses, ...] = ()

    @property
    def checked(self) -> bool:
        """Whether the uncertainty of the constants is known."""
        return bool(self.parts) or self.dof > 0

    @property
    def tested_between(self) -> bool:
        """Whether temperatures that the fit did not use have tested its functions of temperature.

        True of a file of an earlier version, which does not say so.
        """
        return not self.held_out or any(h.what == TEMPERATURE for h in self.held_out)

    @property
    def tested(self) -> bool:
        """Whether poses that the fit did not use have tested it."""
        return self.left_out_length_g is not None

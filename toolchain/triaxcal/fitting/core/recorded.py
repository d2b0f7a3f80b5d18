"""What a calibration from a recording knows beyond the twelve constants."""

from __future__ import annotations

from dataclasses import dataclass

from triaxcal.model.types import FloatArray
from triaxcal.poses.poses import PoseSet


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
    dof : int
        Degrees of freedom of the residuals; 0 where there are as many constants as poses.
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
    """

    poses: PoseSet
    route: str
    covariance: FloatArray
    dof: int
    rms_g: float
    rms_free_g: float
    held_out_g: float | None
    left_out_length_g: float | None
    condition: float
    weakest: str
    residual_g: FloatArray
    findings: tuple[str, ...]
    terms: TermsCovariance = NO_TERMS_COVARIANCE

    @property
    def checked(self) -> bool:
        """Whether anything but the fitted constants themselves checks them."""
        return self.dof > 0

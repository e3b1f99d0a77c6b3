"""Results of the comparison of cameras: plain numbers, ready for JSON; None where there is no value."""

from dataclasses import dataclass
from typing import Literal

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Key, LeftOut
from radiometry.fleet.verdicts import Judgement, Outcome


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """The largest deviation from the shared value that is accepted.

    Attributes
    ----------
    limit : float
        In the unit of the cost.
    kind : {"relative", "absolute"}
    of : str
        Of what it is a limit.
    """

    limit: float
    unit: str
    kind: str
    of: str


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """The distance of one level from the mean of all.

    Attributes
    ----------
    label : str
        A serial number, or "body with lens" where a body had several lenses.
    cost : Quantity or None
        The same as its effect on the result; None where unknown.
    """

    label: str
    repeats: int
    deviation: Quantity
    cost: Quantity | None


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Effect of the levels of one factor.

    Attributes
    ----------
    factor : {"camera", "body", "lens"}
        Body and lens where swaps separate the two.
    between_variance : Quantity
        Variance component, not below 0.
    judgement : Judgement or None
        None where the tests could not be made.
    """

    factor: Literal["camera", "body", "lens"]
    deviations: tuple[Deviation, ...]
    between_variance: Quantity
    dof: int
    f_statistic: float | None
    f_p_value: float | None
    judgement: Judgement | None


@dataclass(frozen=True, kw_only=True)
class ParameterVerdict:
    """Verdict on one parameter: does one value serve all cameras that have it.

    Attributes
    ----------
    judged : bool
        False: no tolerance was given for it, and the fleet's verdict ignores it.
    mean : Quantity
        The shared value, the unweighted mean; its uncertainty is from repeatability alone.
    within_variance : Quantity or None
        Of one determination repeated on one camera.
    dof : int
        Degrees of freedom of the repeatability.
    f_statistic : float or None
        Of all that makes cameras differ, bodies and lenses together.
    repeatability : Quantity or None
        Of one determination, as its effect on the result.
    cost : Quantity or None
        The largest cost of sharing for a camera.
    costliest : str or None
        The camera that this cost is of.
    repeats_needed : int or None
        Of each camera, to show that they are alike, where that is open and nothing was found.
    cameras_without : tuple of str
        Those that have no such coefficient.
    """

    key: Key
    outcome: Outcome
    judged: bool
    said: str
    cameras: int
    repeats: int
    mean: Quantity
    within_variance: Quantity | None = None
    between_variance: Quantity | None = None
    dof: int
    f_statistic: float | None = None
    f_p_value: float | None = None
    effects: tuple[Effect, ...] = ()
    judgement: Judgement | None = None
    tolerance: Tolerance | None
    repeatability: Quantity | None = None
    cost: Quantity | None = None
    costliest: str | None = None
    repeats_needed: int | None = None
    cameras_without: tuple[str, ...]
    flags: tuple[Raised, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FleetVerdict:
    """The verdict on a fleet: per_camera when any parameter is; shared when all that were judged are."""

    outcome: Outcome
    said: str
    parameters: tuple[ParameterVerdict, ...]
    left_out: tuple[LeftOut, ...]

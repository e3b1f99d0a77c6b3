"""Exponents of exposure time, f-number and ISO value in a table of mean signals."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import Quantity
from radiometry.fitting.sources import IMPLAUSIBLE_SCATTER_REL
from radiometry.records import Record, about

SETTINGS = ("exposure_time_s", "f_number", "iso")

# Eight stops below white. Dark signals are stated in whole DN and drift by some: of the 64 DN that this is in
# 14 bits one DN is 1.6 %, and it bends a logarithm the more the lower it stands.
LOWEST_SHARE = 2.0**-8

HIGHEST_SHARE = 0.95  # Above it single pixels clip before the mean does, and many sensors bend

# Of a setting, from its least to its largest, relative. A sixth of a stop is 12 %; what is less has been
# rounded in another way and was not set, and an exponent of it would be any number.
SMALLEST_STEP = 0.01

_LARGEST_CONDITION = 1e4


class SeriesRow(Record):
    """Settings and mean signal of one frame."""

    exposure_time_s: float
    f_number: float
    iso: float
    signal_dn: float  #: Mean signal, dark included [DN]
    dark_dn: float | None = None  #: Dark signal of this frame [DN], if it has its own


class LeftOut(Record):
    """A row that was not used."""

    row: int = about("Number of the row, from 0.")
    reason: str = about("Reason why it was not used.")


class ExponentFit(Record):
    """Exponents of the settings that vary."""

    exponents: dict[str, Quantity] = about("Exponent by name of the setting.")
    used: int = about("Number of rows used.")
    left_out: tuple[LeftOut, ...] = about("Rows that were not used.")
    scatter_rel: float = about("Relative scatter of the signal about the fit.")
    flags: tuple[Raised, ...] = about("`scatter_implausible` if it is above 5 %, as in a luminance fit.")


def fit_exponents(rows: Sequence[SeriesRow], *, dark_dn: float, white_level_dn: float) -> ExponentFit:
    """Fit signal = A t^a N^b S^s by ordinary least squares of logarithms.

    The uncertainties are from the scatter of the residuals, with n - p degrees of freedom::

        ln(signal - dark) = ln A + a ln t + b ln N + s ln S

    A linear sensor behind an ideal lens has a = 1, b = -2, s = 1. Rows below 1/256 or above 95 % of the span
    from dark to white are not used, and are listed in `left_out`.

    Parameters
    ----------
    rows : sequence of SeriesRow
        Frames with settings and signals.
    dark_dn : float
        Dark signal of rows that have none of their own [DN].
    white_level_dn : float
        White level [DN].

    Returns
    -------
    ExponentFit
        One exponent per setting that varies, by more than 1 %.

    Raises
    ------
    InputRejected
        `fit_incomplete` if no setting varies among the remaining rows, two vary
        only together, or too few rows remain.
    """
    kept, left_out = _cut(rows, dark_dn=dark_dn, white_level_dn=white_level_dn)
    if not kept:
        raise shared.FIT_INCOMPLETE.reject(f"No row can be used. {_explain(left_out)}")
    logs = {name: np.log([getattr(row, name) for row, _ in kept]) for name in SETTINGS}
    varied = [name for name in SETTINGS if np.ptp(logs[name]) > SMALLEST_STEP]
    _require_enough(len(kept), varied, left_out)
    columns = np.column_stack([logs[name] - logs[name].mean() for name in varied])
    _require_independent(columns, varied)
    design = np.column_stack([np.ones(len(kept)), columns])
    response = np.log([above for _, above in kept])
    theta, *_ = np.linalg.lstsq(design, response, rcond=None)
    residual = response - design @ theta
    variance = float(residual @ residual) / (len(kept) - design.shape[1])
    scatter = math.sqrt(variance)
    wild = [shared.SCATTER_IMPLAUSIBLE.at("", f"Scatter about the fit: {scatter:.0%} of the signal.")]
    covariance = variance * np.linalg.inv(design.T @ design)
    return ExponentFit(
        exponents={
            name: Quantity(float(theta[index]), math.sqrt(float(covariance[index, index])), "1")
            for index, name in enumerate(varied, start=1)
        },
        used=len(kept),
        left_out=tuple(left_out),
        scatter_rel=scatter,
        flags=tuple(wild if scatter > IMPLAUSIBLE_SCATTER_REL else ()),
    )


def _cut(
    rows: Sequence[SeriesRow], *, dark_dn: float, white_level_dn: float
) -> tuple[list[tuple[SeriesRow, float]], list[LeftOut]]:
    """Return the usable rows with their signal above dark, and the others with the reason."""
    kept, left_out = [], []
    for index, row in enumerate(rows):
        dark = dark_dn if row.dark_dn is None else row.dark_dn
        span, above = white_level_dn - dark, row.signal_dn - dark
        if span <= 0.0:
            reason = f"its dark signal {dark:g} DN is not below the white level {white_level_dn:g} DN"
        elif above <= 0.0 or above < LOWEST_SHARE * span:
            reason = f"{above:g} DN above dark: less than 1/256 of the way to white ({span:g} DN)"
        elif above > HIGHEST_SHARE * span:
            reason = (
                f"saturated: {row.signal_dn:g} DN is above 95 % of the way to white ({white_level_dn:g} DN)"
            )
        else:
            kept.append((row, above))
            continue
        left_out.append(LeftOut(row=index, reason=reason))
    return kept, left_out


def _require_enough(count: int, varied: Sequence[str], left_out: Sequence[LeftOut]) -> None:
    if not varied:
        raise shared.FIT_INCOMPLETE.reject(
            f"No setting varies among the usable rows ({count}): vary exposure time, f-number or ISO. "
            f"{_explain(left_out)}"
        )
    needed = len(varied) + 2
    if count < needed:
        raise shared.FIT_INCOMPLETE.reject(
            f"Usable rows: {count}. {len(varied)} exponents with their standard errors need at least "
            f"{needed}. {_explain(left_out)}"
        )


def _explain(left_out: Sequence[LeftOut]) -> str:
    named = [f"row {each.row}: {each.reason}" for each in left_out[:3]]
    more = f"; and {len(left_out) - 3} more" if len(left_out) > 3 else ""
    return f"Left out: {'; '.join(named)}{more}." if named else "None was left out."


def _require_independent(columns: NDArray[np.float64], varied: Sequence[str]) -> None:
    """Refuse settings that change only together, whose effects on the signal cannot be separated."""
    spread = columns / np.linalg.norm(columns, axis=0)
    if np.linalg.cond(spread) > _LARGEST_CONDITION:
        raise shared.FIT_INCOMPLETE.reject(
            f"{' and '.join(varied)} vary only together: their exponents cannot be told apart. Add rows in "
            "which one of them changes alone."
        )

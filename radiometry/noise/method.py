"""Noise: characterisation after EMVA 1288 by ISO value and channel, from stacks of equal frames.

The photon transfer gives the system gain K [DN/e-] [1]_::

    sigma_y^2 - sigma_y.dark^2 = K (mu_y - mu_y.dark)

Read noise, saturation capacity, dynamic range and SNR follow from it; linearity, dark current, DSNU and
PRNU are added. The photon flux of the standard is left out: light is not measured here, so there is no
quantum efficiency and no threshold in photons.

References
----------
.. [1] EMVA Standard 1288, release 3.1 (the linear model of release 4.0)
"""

from collections.abc import Sequence

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import MOST_DOF, CoefficientValue, Extracted, Quantity, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import CHANNELS
from radiometry.noise.blocks import Features, FrameRow, extract_features
from radiometry.noise.findings import check_fits, check_headers
from radiometry.noise.fit import fit_channel
from radiometry.noise.points import collect_stacks, describe_points, missing
from radiometry.noise.results import TRANSFER_EQUATION, ChannelFit, Fit
from radiometry.noise.rows import Params

FIGURES = (
    "system_gain_dn_per_e",
    "read_noise_e",
    "read_noise_dn",
    "full_well_e",
    "linearity_error_rel",
    "snr_max",
    "dynamic_range_db",
    "dynamic_range_stops",
    "dark_current_e_per_s",
    "dark_current_dn_per_s",
    "dsnu_e",
    "dsnu_dn",
    "prnu_rel",
)


def extract(
    frame: Frame, regions: Sequence[Region], *, header: FrameHeader, exposure: Exposure | None
) -> Extracted[Features]:
    """Read a square of raw samples of every channel.

    Raises
    ------
    InputRejected
        `roi_empty` if no pixel, or no square of 16 samples a side, lies in the region.
    """
    del exposure
    return extract_features(frame, regions, header=header)


def fit(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Evaluate every channel at every ISO value of a campaign.

    Raises
    ------
    InputRejected
        `fit_incomplete` if frames are not extracted yet, or if no channel has a pair of
        dark frames and pairs at three light levels; `fit_failed` if no channel's noise
        grows with its signal.

    Notes
    -----
    The same input in any order gives the same result to the last bit. All numbers are finite; what does not
    exist is None.

    Flags per ISO value and channel: pair_light_drift, dark_exposure_differs, dark_not_dark, dark_clipped,
    no_photon_transfer, linearity_error_large, prnu_large, few_points, scatter_exceeds_uncertainty,
    full_well_not_reached, read_noise_below_rounding, pattern_not_resolved, dark_current_compensated. Flag
    of the whole fit: rendered.
    """
    lacking = missing(rows, params)
    if lacking:
        raise InputRejected(shared.FIT_INCOMPLETE, f"The fit cannot start: {'; '.join(lacking)}.")
    by_channel = collect_stacks(rows, params)
    fitted = [each for stacks in by_channel.values() if (each := fit_channel(stacks, params))]
    if not any(each.transfer for each in fitted):
        reasons = dict.fromkeys(level.left_out for each in fitted for level in each.fit.levels)
        raise InputRejected(
            shared.FIT_FAILED,
            "No channel's noise grows with its signal over three levels or more, so there is no system gain. "
            f"Left out: {'; '.join(reason for reason in reasons if reason) or 'nothing'}.",
        )
    stacks = [stack for group in by_channel.values() for stack in group]
    return Fit(
        channel_fits=tuple(each.fit for each in fitted),
        points=describe_points(rows, stacks, fitted, params),
        flags=(*check_headers(rows), *check_fits(fitted)),
    )


def list_coefficients(fit: Fit) -> tuple[CoefficientValue, ...]:
    """Return the coefficients of every ISO value and channel, those that exist."""
    return tuple(
        CoefficientValue(
            name=name,
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            unit=quantity.unit,
            model=TRANSFER_EQUATION,
            iso=channel.iso,
            band=None if channel.channel in CHANNELS else channel.channel,
            channel=channel.channel,
            flags=_flags_of(fit, channel),
            effective_dof=channel.effective_dof.get(name, MOST_DOF) if channel.effective_dof else None,
        )
        for channel in fit.channel_fits
        for quantities in (_list_quantities(channel),)
        for name in FIGURES
        if (quantity := quantities.get(name)) is not None
    )


def _list_quantities(channel: ChannelFit) -> dict[str, Quantity | None]:
    parts = (channel, channel.transfer, channel.dark_current)
    found = {name: getattr(part, name) for part in parts for name in FIGURES if hasattr(part, name)}
    return {**found, "linearity_error_rel": channel.linearity.error_rel if channel.linearity else None}


def _flags_of(fit: Fit, channel: ChannelFit) -> tuple[str, ...]:
    wheres = {"", f"iso {channel.iso:g} {channel.channel}"}
    return tuple(sorted({raised.flag for raised in fit.flags if raised.where in wheres}))

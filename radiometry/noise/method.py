"""Noise: per ISO value and channel what EMVA 1288 characterises a camera by, from stacks of equal frames.

    sigma_y^2 - sigma_y.dark^2 = K (mu_y - mu_y.dark)      K the system gain [DN/e-]

and from it read noise, saturation capacity, dynamic range, SNR; with linearity, dark current, DSNU and PRNU.
Source: EMVA Standard 1288, release 3.1 (the linear model of release 4.0), without its photon flux: light is
not measured here, so there is no quantum efficiency and no threshold in photons.
"""

from collections.abc import Sequence

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import CoefficientValue, Extracted, Quantity, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import CHANNELS
from radiometry.noise.blocks import Features, FrameRow, extract_features
from radiometry.noise.findings import check_fits, check_rendered
from radiometry.noise.fit import fit_channel
from radiometry.noise.planning import plan
from radiometry.noise.points import collect_stacks, describe_points, list_missing
from radiometry.noise.results import TRANSFER_EQUATION, ChannelFit, Fit, LevelResult, Point
from radiometry.noise.rows import Params
from radiometry.noise.verdicts import judge

__all__ = [
    "ChannelFit",
    "Features",
    "Fit",
    "FrameRow",
    "LevelResult",
    "Params",
    "Point",
    "extract",
    "fit",
    "judge",
    "list_coefficients",
    "missing",
    "plan",
]


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
    """Keep a square of raw samples of every channel; without a drawn region ``regions`` is the whole frame.

    ``exposure`` is part of the door and says nothing about samples.
    Raises InputRejected(roi_empty)
    """
    del exposure
    return extract_features(frame, regions, header=header)


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    """Say, by name, what the fit still lacks; empty when it can start with every frame."""
    return list_missing(rows, params, unread=unread)


def fit(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Work out every channel at every ISO value of a campaign.

    Same input in any order, same answer to the last bit. All numbers are finite; what does not exist is None.

    Flags
      per ISO value and channel: pair_light_drift, dark_exposure_differs, dark_not_dark, dark_clipped,
      no_photon_transfer, linearity_error_large, prnu_large,
      few_points, scatter_exceeds_uncertainty, full_well_not_reached, read_noise_below_rounding,
      pattern_not_resolved, dark_current_compensated; of the whole: rendered
    Raises InputRejected
      fit_incomplete if frames are not extracted yet, or no channel has a pair of dark frames and pairs at
      three light levels; fit_failed if no channel's noise grows with its signal
    """
    lacking = list_missing(rows, params)
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
        flags=(*check_rendered(rows), *check_fits(fitted)),
    )


def list_coefficients(fit: Fit) -> tuple[CoefficientValue, ...]:
    """Give the figures of every ISO value and channel, those that exist."""
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

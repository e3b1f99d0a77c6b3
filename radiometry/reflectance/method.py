"""Reflectance: per band the coefficient K that converts irradiance at the sensor into reflectance.

    R cos(theta) = K I_sq / I_ss          K = R cos(theta) I_ss / I_sq   of a panel of known R

I_sq is the band's signal after black and vignetting, I_ss the sunshine sensor's reading of the same moment.
There is one K per band, camera and sunshine sensor, for one flight. The method follows "How to convert
Sequoia images to reflectance?" 1.1; the divisions by the gain index and of black by the vignetting, in public
scripts, are not followed.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from radiometry.findings import InputRejected, Raised, shared
from radiometry.fitting.evidence import CoefficientValue, Extracted, FrameEvidence, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.reflectance import codes
from radiometry.reflectance.findings import check_candidates, check_fit
from radiometry.reflectance.fit import check_times, describe_point, fit_bands
from radiometry.reflectance.imaging import Features, extract_features, find_black_dn
from radiometry.reflectance.panel_code import FoundPanel, find_panel, find_stated_panel
from radiometry.reflectance.points import (
    Candidate,
    collect_candidates,
    list_bands_without_reflectance,
    list_missing,
    require_flat_angle,
    require_one_panel,
)
from radiometry.reflectance.results import Fit
from radiometry.reflectance.rows import FrameRow, Params, Reading


def extract(
    frame: Frame, regions: Sequence[Region], *, header: FrameHeader, exposure: Exposure | None
) -> Extracted[Features]:
    """Compute the statistics and the signal of a region of one band."""
    if exposure is None:
        raise ValueError("a panel or field frame without its exposure")
    features = extract_features(frame, regions[0].polygon, header=header, exposure=exposure)
    return Extracted(statistics=(features.statistics,), features=features)


def find_region(frame: Frame, *, header: FrameHeader) -> FoundPanel | None:
    """Find the panel in a whole frame of one band: as the camera states it, else by its code."""
    band = header.multispectral
    if band is None or frame.samples_dn.ndim != 2:
        return None
    stated = None
    if band.panel_region is not None:
        black_dn = find_black_dn(band, header.black_level_dn)
        stated = find_stated_panel(frame.samples_dn, band.panel_region, black_dn=black_dn)
    if stated and band.panel_serial:
        return stated
    read = find_panel(frame.samples_dn)
    return replace(stated, serial=read.serial if read else None) if stated else read


def make_row(evidence: FrameEvidence[Features]) -> FrameRow:
    """Convert the evidence of a frame to the row that the fit uses."""
    if evidence.exposure is None:
        raise ValueError(f"a panel or field frame without its exposure: {evidence.frame}")
    return FrameRow(
        frame=evidence.frame,
        role=evidence.role,
        header=evidence.header,
        exposure=evidence.exposure,
        features=evidence.features,
        has_region=evidence.has_region,
        panel_serial=evidence.identified,
    )


def missing(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params, *, unread: Sequence[str] = ()
) -> tuple[str, ...]:
    """List by name what the fit still lacks.

    A band without a panel reflectance is named although the other bands may be enough: `fit` leaves it out.
    """
    lacking = list_missing(rows, readings, params, unread=unread)
    return (*lacking, *list_bands_without_reflectance(rows, readings, params))


def fit(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> Fit:
    """Fit K for every band of a campaign's panel frames.

    The same input in any order gives the same result to the last bit. All values are finite; what does not
    exist is None.
    """
    require_flat_angle(params.incidence_angle_deg)
    lacking = list_missing(rows, readings, params)
    if lacking:
        raise InputRejected(shared.FIT_INCOMPLETE, f"The fit cannot start: {'; '.join(lacking)}.")
    candidates = collect_candidates(rows, readings, params)
    used = [candidate for candidate in candidates if not candidate.left_out]
    if not used:
        raise _explain(candidates)
    _require_one_pair(used, params)
    require_one_panel((each.row for each in used), readings)
    used, doubts = check_times(used)
    fits = fit_bands(used, params)
    flags: list[Raised] = [*check_candidates(candidates), *doubts]
    for band, band_fit in fits.items():
        flags += check_fit(band_fit, [each for each in used if each.band.band == band])
    if params.normalisation == "panel_only":
        flags.append(codes.PANEL_ONLY.at("", "Chosen by the parameters of this fit."))
    return Fit(
        band_fits=tuple(fits.values()),
        points=tuple(describe_point(each, params, fits.get(each.band.band)) for each in candidates),
        flags=tuple(flags),
    )


def list_coefficients(fitted: Fit) -> tuple[CoefficientValue, ...]:
    """List K of every band, by rising wavelength where the files state it."""
    coefficients = (each.coefficient for each in fitted.band_fits)
    return tuple(
        CoefficientValue(
            name="reflectance_k",
            value=coefficient.reflectance_k,
            standard_uncertainty=coefficient.reflectance_k_standard_uncertainty,
            unit=coefficient.reflectance_k_unit,
            band=coefficient.band,
            model=coefficient.normalisation,
            coverage_factor=coefficient.coverage_factor,
            flags=_flags_of(fitted, coefficient.band),
        )
        for coefficient in sorted(coefficients, key=lambda each: (each.wavelength_nm or 0.0, each.band))
    )


def _flags_of(fitted: Fit, band: str) -> tuple[str, ...]:
    """Collect the flags of the whole, of the band, and of its frames."""
    frames = {f"frame {point.frame}" for point in fitted.points if point.band == band}
    where = {"", f"band {band}", *frames}
    return tuple(sorted({raised.flag for raised in fitted.flags if raised.where in where}))


def configure(fitted: Fit) -> dict[str, Any]:
    """Return the sunshine sensor that the fit holds with: K belongs to the pair."""
    serials = sorted({each.coefficient.sunshine_serial or "" for each in fitted.band_fits} - {""})
    return {"sunshine_sensor": {"serial": serials[0]}} if serials else {}


def _explain(candidates: Sequence[Candidate]) -> InputRejected:
    """Name what keeps every panel frame out: by its own code where there is one for all."""
    found = {candidate.left_out_code for candidate in candidates}
    reasons = sorted({f"{each.band.band}: {each.left_out}" for each in candidates})
    code = found.pop() if len(found) == 1 else None
    what = "; ".join(reasons) or "none of the panel frames is a multispectral camera's"
    if code is None or code == codes.PANEL_SATURATED:
        what += ". Take the panel again, neither saturated nor dark, and state what it reflects in each band."
    return InputRejected(code or shared.FIT_INCOMPLETE, f"No panel frame can be used. {what}")


def _require_one_pair(used: Sequence[Candidate], params: Params) -> None:
    """Refuse panel frames of several cameras or sunshine sensors: K belongs to one pair."""
    cameras = {each.row.header.serial for each in used if each.row.header.serial}
    sensors = {each.band.sunshine_serial for each in used if each.band.sunshine_serial}
    for what, found, code in (
        ("cameras", cameras, shared.WRONG_CAMERA),
        (
            "sunshine sensors",
            sensors if params.normalisation == "sunshine" else set(),
            codes.WRONG_SUNSHINE_SENSOR,
        ),
    ):
        if len(found) > 1:
            raise InputRejected(
                code,
                f"The panel frames are of several {what}: {', '.join(sorted(found))}. K belongs to one "
                "camera and one sunshine sensor: leave the others' frames out.",
            )

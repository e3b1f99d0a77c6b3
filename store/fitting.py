"""From a campaign's evidence to a version: what is missing, what goes in, and what is written down."""

import hashlib
import json
from dataclasses import replace
from importlib.metadata import version as package_version
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.luminance.results import Fit
from radiometry.luminance.rows import Params
from store.codec import encode
from store.columns import new_id
from store.queries.calibrations import next_version
from store.queries.evidence import Evidence
from store.software import CODE_VERSION, EXTRACTOR
from store.tables import Calibration, Camera, Campaign, CoefficientRow, Roi


def list_missing(campaign: Campaign, evidence: Evidence, params: Params) -> list[str]:
    """What a fit still needs, by name; empty when it can start."""
    return list(
        methods.missing(campaign.method, evidence.frames, evidence.readings, params, unread=evidence.unread)
    )


def with_campaign(params: Params, campaign: Campaign) -> Params:
    """What the campaign says of the target goes into every fit of it."""
    return replace(params, panel_rho=campaign.surface_reflectance)


def write_version(
    session: Session, campaign: Campaign, evidence: Evidence, params: Params, fit: Fit, *, by: str
) -> Calibration:
    """Write the next version of the camera; the same content again is the version that exists."""
    inputs = _inputs(session, evidence)
    parameters = encode(params)
    content_sha256 = hash_content(inputs, parameters)
    found = session.scalar(
        select(Calibration).where(
            Calibration.campaign_id == campaign.id, Calibration.content_sha256 == content_sha256
        )
    )
    if found is not None:
        return found
    calibration = Calibration(
        id=new_id("cal"),
        organisation_id=campaign.organisation_id,
        camera_id=campaign.camera_id,
        campaign_id=campaign.id,
        method=campaign.method,
        version=next_version(session, campaign.camera_id, campaign.method),
        configuration=_configuration(session.get_one(Camera, campaign.camera_id)),
        parameters=parameters,
        inputs=inputs,
        result=_result(fit, evidence),
        result_schema=methods.schema_version(campaign.method),
        software=_software(),
        content_sha256=content_sha256,
        created_by=by,
    )
    session.add(calibration)
    session.flush()
    session.add_all(_coefficients(calibration.id, fit))
    session.flush()
    return calibration


def hash_content(inputs: dict[str, Any], parameters: dict[str, Any]) -> str:
    """The identity of what this code makes of these inputs."""
    content = json.dumps([inputs, parameters, CODE_VERSION], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


def _inputs(session: Session, evidence: Evidence) -> dict[str, Any]:
    """Everything that the result follows from, by content: no id, no time of arrival."""
    regions = {
        roi.id: roi for roi in session.scalars(select(Roi).where(Roi.id.in_(set(evidence.rois.values()))))
    }
    frames = []
    for frame in evidence.frames:
        region = regions[evidence.rois[frame.frame]]
        frames.append(
            {
                "frame": frame.frame,
                "sha256": evidence.hashes[frame.frame],
                "role": frame.role,
                **({"scene": frame.scene} if frame.scene else {}),
                "exposure": encode(frame.exposure),
                "roi_sha256": region.sha256,
            }
        )
    return {
        "frames": frames,
        "readings": [encode(reading) for reading in evidence.readings],
        "meters": evidence.meters,
        "rois": {roi.sha256: roi.points for roi in sorted(regions.values(), key=lambda roi: roi.sha256)},
        "extractor": EXTRACTOR,
    }


def _result(fit: Fit, evidence: Evidence) -> dict[str, Any]:
    ids = {name: frame_id for frame_id, name in evidence.names.items()}
    result: dict[str, Any] = encode(fit)
    for point in result["points"]:
        point["frame_id"] = ids[point["frame"]]
    return result


def _coefficients(calibration_id: str, fit: Fit) -> list[CoefficientRow]:
    rows: list[CoefficientRow] = []
    flags = {flag.where: [] for flag in fit.flags}  # type: dict[str, list[str]]
    for flag in fit.flags:
        flags[flag.where].append(flag.flag)
    for iso_fit in fit.iso_fits:
        coefficient = iso_fit.coefficient
        raised = sorted({*flags.get("", []), *flags.get(f"iso {coefficient.iso:g}", [])})
        figures = (
            (
                "luminance_k",
                coefficient.luminance_k,
                coefficient.luminance_k_standard_uncertainty,
                coefficient.luminance_k_unit,
            ),
            (
                "dark_signal_dn",
                coefficient.dark_signal_dn,
                coefficient.dark_signal_standard_uncertainty_dn,
                "DN",
            ),
        )
        for name, value, uncertainty, unit in figures:
            rows.append(
                CoefficientRow(
                    calibration_id=calibration_id,
                    name=name,
                    value=value,
                    standard_uncertainty=uncertainty,
                    unit=unit,
                    iso=coefficient.iso,
                    channel=coefficient.channel,
                    model=coefficient.model,
                    flags=raised,
                )
            )
    rows.sort(key=lambda row: (row.name != "luminance_k", row.iso))
    for position, row in enumerate(rows):
        row.position = position
    return rows


def _configuration(camera: Camera) -> dict[str, Any]:
    """What else a version holds for: the lens, where it is named."""
    lens = {"make": camera.lens_make, "model": camera.lens_model, "serial": camera.lens_serial}
    return {"lens": {name: value for name, value in lens.items() if value}} if camera.lens_model else {}


def _software() -> dict[str, Any]:
    return {"stilb": CODE_VERSION, "extractor": EXTRACTOR} | {
        name: package_version(name) for name in ("numpy", "scipy", "rawpy")
    }

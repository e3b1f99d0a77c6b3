"""Fit of a campaign's evidence to a version: what is missing, what goes in, and what is written down."""

import hashlib
import json
from dataclasses import replace
from functools import cache
from importlib.metadata import version as package_version
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods, records
from radiometry.findings import grouping, shared
from radiometry.specification.parameters import list_parameters
from radiometry.spectral.mismatch import find_response
from store.codec import decode, encode
from store.queries import add, by_id
from store.queries.calibrations import next_version
from store.queries.evidence import Evidence
from store.queries.frames import extractor_of, is_told
from store.software import FIT_CODE_VERSION, read_version
from store.tables import Calibration, Camera, Campaign, CoefficientRow, Roi, new_id

_UNTOLD = grouping.Cause(
    "nobody has said what is photographed: describe the board in the campaign's target", shared.TARGET_MISSING
)

_READ_AGAIN = "frames are read again, after an upgrade of stilb or a change of the target"


def make_params(session: Session, campaign: Campaign, **said: Any) -> Any:  # noqa: ANN401 (the method's own)
    """A fit's parameters: what somebody says, what campaign and camera say, and the method's defaults."""
    kind = methods.get_method(campaign.method).params
    stated = {each.field: each for each in list_parameters(kind)}
    camera = session.get_one(Camera, campaign.camera_id)
    said |= {
        each.field: getattr(campaign, each.name) for each in stated.values() if each.given_by == "campaign"
    }
    if "pixel_pitch_um" in stated:
        said.setdefault("pixel_pitch_um", camera.pixel_pitch_um)
    if "camera_response" in stated and said["camera_response"] is None:
        said["camera_response"] = find_response(camera.make, camera.model)
    return decode(kind, said)


def read_params(campaign: Campaign, stored: dict[str, Any]) -> Any:  # noqa: ANN401 (the method's own)
    return decode(methods.get_method(campaign.method).params, stored)


def leave_out_doubtful(params: Any, evidence: Evidence) -> Any:  # noqa: ANN401 (the method's own)
    """The parameters, with the frames that no fit may use among those left out; what a person said stands."""
    said = {exclusion.frame for exclusion in params.exclude}
    if not (more := [exclusion for exclusion in evidence.doubtful if exclusion.frame not in said]):
        return params
    return replace(params, exclude=tuple(sorted((*params.exclude, *more), key=lambda each: each.frame)))


def list_missing(campaign: Campaign, evidence: Evidence, params: Any) -> list[str]:  # noqa: ANN401
    """List by name what a fit still needs; empty if it can start."""
    untold = [] if is_told(campaign) else [_UNTOLD]
    if evidence.outdated:
        # what else is missing is known once they are read
        again = f"{len(evidence.outdated)} of {len(evidence.frames)} {_READ_AGAIN}"
        return [*untold, grouping.Cause(again, shared.NOT_EXTRACTED)]
    lacking = methods.get_method(campaign.method).missing(
        evidence.frames, evidence.readings, leave_out_doubtful(params, evidence), unread=evidence.unread
    )
    return [*untold, *lacking, *(evidence.unusable if lacking else ())]


class NewVersion(records.Record):
    """A version that is not written yet: all of it but its id and number, which others may take meanwhile."""

    columns: dict[str, Any]
    coefficients: list[dict[str, Any]]


def make_version(
    session: Session,
    campaign: Campaign,
    evidence: Evidence,
    params: Any,  # noqa: ANN401 (the method's own)
    fit: Any,  # noqa: ANN401 (the method's own)
    *,
    by: str,
) -> NewVersion:
    spec = methods.get_method(campaign.method)
    inputs, parameters = _inputs(session, campaign, evidence), encode(params)
    kept, camera = CoefficientRow.__table__.c, session.get_one(Camera, campaign.camera_id)
    registered = {"make": camera.lens_make, "model": camera.lens_model, "serial": camera.lens_serial}
    lens = {name: value for name, value in (campaign.lens or registered).items() if value}
    return NewVersion(
        columns={
            **{name: getattr(campaign, name) for name in ("organisation_id", "camera_id", "method")},
            "campaign_id": campaign.id,
            # the campaign's lens, else the camera's, where one is named
            "configuration": {**({"lens": lens} if "model" in lens else {}), **spec.configure(fit)},
            "parameters": parameters,
            "inputs": inputs,
            "result": _result(fit, evidence),
            "result_schema": spec.schema_version,
            "software": _software(extractor_of(campaign)),
            "content_sha256": hash_content(inputs, parameters),
            "created_by": by,
        },
        coefficients=[
            {name: value for name, value in encode(figure).items() if name in kept}
            for figure in spec.list_coefficients(fit)
        ],
    )


def write_version(session: Session, new: NewVersion) -> Calibration:
    """Write the next version of the camera; the same content again is the version that exists."""
    same = {name: new.columns[name] for name in ("campaign_id", "content_sha256")}
    if (found := session.scalar(select(Calibration).filter_by(**same))) is not None:
        return found
    number = next_version(session, new.columns["camera_id"], new.columns["method"])
    calibration = Calibration(id=new_id("cal"), version=number, **new.columns)
    add(session, calibration)
    # together, as one entry of the audit trail
    for position, columns in enumerate(new.coefficients):
        session.add(CoefficientRow(calibration_id=calibration.id, position=position, **columns))
    session.flush()
    return calibration


def hash_content(inputs: dict[str, Any], parameters: dict[str, Any]) -> str:
    """The identity of what this code makes of these inputs."""
    content = json.dumps([inputs, parameters, FIT_CODE_VERSION], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


def _inputs(session: Session, campaign: Campaign, evidence: Evidence) -> dict[str, Any]:
    """Everything that the result follows from, by content: no id, no time of arrival."""
    regions = by_id(session, Roi, set(evidence.rois.values()))
    parts = {roi.sha256: roi.parts for roi in regions.values() if roi.parts}
    frames = []
    for frame in evidence.frames:
        region = regions[evidence.rois[frame.frame]]
        frames.append(
            {
                "frame": frame.frame,
                "sha256": evidence.hashes[frame.frame],
                "role": frame.role,
                **({"scene": frame.scene} if getattr(frame, "scene", None) else {}),
                **({"exposure": encode(frame.exposure)} if frame.exposure else {}),
                **({"clock_offset": offset} if (offset := evidence.offsets.get(frame.frame)) else {}),
                "roi_sha256": region.sha256,
            }
        )
    return {
        "frames": frames,
        "readings": [encode(reading) for reading in evidence.readings],
        **evidence.references,
        **({"target": campaign.target} if campaign.target else {}),
        **({"roi_parts": parts} if parts else {}),
        "rois": {roi.sha256: roi.points for roi in sorted(regions.values(), key=lambda roi: roi.sha256)},
        "extractor": extractor_of(campaign),
    }


def _result(fit: Any, evidence: Evidence) -> dict[str, Any]:  # noqa: ANN401
    ids = {name: frame_id for frame_id, name in evidence.names.items()}
    result: dict[str, Any] = encode(fit)
    for point in result["points"]:
        point["frame_id"] = ids[point["frame"]]
    return result


def read_result(calibration: Calibration) -> Any:  # noqa: ANN401 (the method's own)
    """The fit as the science gave it: the store adds each point's frame by id."""
    points = [
        {name: value for name, value in point.items() if name != "frame_id"}
        for point in calibration.result["points"]
    ]
    return decode(methods.get_method(calibration.method).result, {**calibration.result, "points": points})


@cache
def _software(extractor: str) -> dict[str, Any]:
    return {"stilb": FIT_CODE_VERSION, "release": read_version(), "extractor": extractor} | {
        name: package_version(name) for name in ("numpy", "scipy", "rawpy")
    }

"""The certificate of a rig's orientation: it rests on the certificates of its cameras' versions."""

import hashlib
import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from radiometry.drawing.text import in_step, write_unit
from radiometry.methods.findings import FINDINGS
from service.certificate.document import build_certificate
from service.certificate.words import EXPANDED, RELATES, WHOLE
from service.press.figures import plain, stamp
from service.press.general import LEGEND, tabulate_points
from service.press.pages import front_matter, list_flag, list_software, list_work
from service.press.sheet import Node, facts, section, table
from service.schemas.certificates import FlagInWords
from service.schemas.rigs import (
    CertifiedCamera,
    CertifiedPose,
    OrientationAnswer,
    RigCertificateAnswer,
    RigStabilityAnswer,
)
from store.queries.calibration_record import CalibrationRecord, state_orientation
from store.queries.fleet import SPEC
from store.tables import Rig

SCHEMA_VERSION = 1
_SUFFICE = (
    "The certificates of the cameras and the triggers of the pictures listed here are sufficient to "
    "recompute every value."
)
_WORST = ("revoked", "draft", "superseded", "published")


def build_rig_certificate(
    rig: Rig,
    records: Sequence[CalibrationRecord],
    at: datetime,
    orientation: Any,  # noqa: ANN401  SPEC.result
    stability: Sequence[Any],
) -> RigCertificateAnswer:
    """Build the whole document from one set, the reference's record first, with the items that it lacks."""
    cameras = [build_certificate(record) for record in records]
    states = [record.status.state for record in records]
    answer = OrientationAnswer.restate(orientation)
    content = {"cameras": [each.content_sha256 for each in cameras], "orientation": answer.dump()}
    sha256 = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    gaps = {(gap.code, gap.message): gap for each in cameras for gap in each.gaps}
    return RigCertificateAnswer(
        schema_version=SCHEMA_VERSION,
        title="Certificate of orientation",
        number=f"{rig.name}-rig-{sha256[:8]}",
        rig_id=rig.id,
        rig=rig.name,
        content_sha256=sha256,
        procedure=SPEC.certificate.procedure,
        equation=SPEC.certificate.equation,
        laboratory=cameras[0].laboratory,
        work=cameras[0].work,
        cameras=[
            CertifiedCamera.restate(each, certificate=each.number, state=state)
            for each, state in zip(cameras, states, strict=True)
        ],
        state=min(states, key=_WORST.index),
        traceability=SPEC.certificate.traceability,
        at=at,
        orientation=answer,
        coefficients=[CertifiedPose(**each) for each in state_orientation(orientation)],
        stability=[RigStabilityAnswer.restate(each) for each in stability],
        flags=[FlagInWords.restate(each, meaning=FINDINGS[each.flag].sentence) for each in orientation.flags],
        software=cameras[0].software,
        created_at=max(each.created_at for each in cameras),
        statements=[RELATES, EXPANDED, _SUFFICE, WHOLE],
        gaps=list(gaps.values()),
    )


def lay_out_rig(certificate: Node) -> Node:
    """Return everything that the template sets."""
    orientation = certificate["orientation"]
    return front_matter(certificate, certificate["state"]) | {
        "item": [
            ["Rig", certificate["rig"]],
            ["Reference", orientation["reference"]],
            ["Cameras", str(len(certificate["cameras"]))],
        ],
        "work": list_work(certificate),
        "results": _tabulate(certificate["coefficients"]),
        "summary": [
            f"{certificate['procedure']}. {certificate['equation']}.",
            LEGEND,
            certificate["traceability"],
        ],
        "authority": [
            ["State", f"{certificate['state']}: as the versions of the cameras are"],
            ["Calculated", f"from versions of {stamp(certificate['created_at'])} and before"],
        ],
        "gaps": [gap["message"] for gap in certificate["gaps"]],
        "flags": [list_flag(flag) for flag in certificate["flags"]],
        "sections": [
            section("Cameras", [_cameras(certificate["cameras"])]),
            section("Result", [facts(_scalars(orientation))]),
            section("Repeats and drift", [_stability(certificate["stability"])]),
            section("Pictures", [tabulate_points(SPEC.certificate.columns, orientation["points"])]),
            list_software(certificate, [["rig", certificate["rig_id"]]]),
        ],
        "statements": certificate["statements"],
    }


def _tabulate(rows: list[Node]) -> Node:
    printed = []
    for row in rows:
        value, u = in_step(row["value"], row["standard_uncertainty"])
        expanded = in_step(row["value"], row["expanded_uncertainty"])[1]
        dof = plain(row["effective_dof"], 3) if row["effective_dof"] <= 1000.0 else ""
        k = f"{row['coverage_factor']:.2f}"
        printed.append([row["camera"], row["name"], value, u, expanded, k, dof, write_unit(row["unit"])])
    head = ["camera", "quantity", "value", "u", "U", "k", "dof", "unit"]
    return table(head, printed, align="llrrrrrl", widths=[2.2, 1.4, 1.4, 1, 1, 0.6, 0.6, 0.6])


def _cameras(cameras: list[Node]) -> Node:
    rows = [
        [
            f"{each['item']['make']} {each['item']['model']}",
            each["item"]["serial"],
            each["certificate"],
            each["state"],
            each["content_sha256"],
        ]
        for each in cameras
    ]
    head = ["camera", "serial number", "certificate", "state", "content SHA-256"]
    return table(head, rows, align="llllh", widths=[1.6, 1.8, 2.4, 1, 3])


def _scalars(orientation: Node) -> list[list[str]]:
    found = {name: each for name, each in orientation.items() if isinstance(each, int | float | str)}
    return [
        [name.replace("_", " "), each if isinstance(each, str) else plain(each)]
        for name, each in found.items()
    ]


def _stability(rows: list[Node]) -> Node:
    def state(row: Node, name: str) -> str:
        if name not in row:
            return "-"
        value, u = in_step(row[name]["value"], row[name]["standard_uncertainty"])
        return f"{value} ± {u} {write_unit(row[name]['unit'])}"

    printed = [
        [
            row["camera"],
            row["name"],
            str(row["sets"]),
            *(state(row, name) for name in ("mean", "repeatability", "change")),
            row["verdict"].replace("_", " "),
        ]
        for row in rows
    ]
    head = ["camera", "quantity", "sets", "mean", "repeatability", "change", "verdict"]
    return table(head, printed, align="llrrrrl", widths=[1.6, 0.9, 0.5, 2, 2, 2, 1.1])

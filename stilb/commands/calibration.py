"""Commands on the way to a version in force."""

import csv
import json
import re
from collections.abc import Sequence
from difflib import get_close_matches
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import RenderableType
from rich.table import Table

from stilb.client import Client
from stilb.commands.output import (
    CampaignNamed,
    Output,
    command,
    complete_camera,
    complete_method,
    complete_model,
    read_moment,
    write_moment,
)
from stilb.commands.terminal import (
    counted,
    figure,
    format_findings,
    holds_for,
    of_coefficients,
    showing,
    table,
)
from stilb.export import ExportProgress
from stilb.field.plan import read_macro
from stilb.field.template import read_methods
from stilb.problem import Problem, Unclear, missing
from stilb.records import DEFAULT_METHOD, Calibration, Quantity
from stilb.transport import without_none

CalibrationId = Annotated[str, typer.Argument(metavar="CALIBRATION", help="Its id.")]
_POINT = re.compile(r"([\d.]+),([\d.]+)")


@command
def roi(
    output: Output,
    campaign: CampaignNamed,
    polygon: str | None = typer.Option(None, help='Corners in pixels: "x,y x,y x,y ...".'),
    imagej: str | None = typer.Option(None, help="makePolygon(...), or a file with it."),
    frame: list[str] | None = typer.Option(None, help="Only this frame, by id or file name; repeatable."),
) -> None:
    """Set or show the region of a campaign's frames."""
    if polygon is not None and imagej is not None:
        raise typer.BadParameter("give either --polygon or --imagej")
    with output.client() as client:
        campaign_id = client.find_campaign(campaign).id
        if frame:
            if polygon is None and imagej is None:
                raise typer.BadParameter("--frame needs --polygon or --imagej")
            drawn = read_polygon(polygon) if polygon is not None else _text_or_file(imagej or "")
            ids = _find_frames(client, campaign_id, frame, "--frame")
            items = [client.set_frame_roi(each, drawn) for each in ids]
            output.answer({"items": items}, f"frames with their own region, being read again: {len(items)}")
            return
        if polygon is not None:
            found = client.set_roi(campaign_id, polygon=read_polygon(polygon))
        elif imagej is not None:
            found = client.set_roi(campaign_id, imagej=_text_or_file(imagej))
        else:
            found = _current_roi(client, campaign_id, campaign)
    corners = " ".join(f"{x:g},{y:g}" for x, y in found["polygon"])
    output.answer(found, corners)


def _current_roi(client: Client, campaign_id: str, named: str) -> dict[str, Any]:
    try:
        return client.roi(campaign_id)
    except Problem as problem:
        if problem.status != HTTPStatus.NOT_FOUND:
            raise
        own = sum(1 for frame in client.frames(campaign_id) if "roi_id" in frame.raw)
        singly = (
            f" {own} of its frames have one of their own, drawn or found by a panel's code." if own else ""
        )
        raise missing(
            f"{named} has no region common to all frames.{singly} "
            f'Draw it on its page, or: stilb roi {named} --imagej "makePolygon(...)"'
        ) from problem


@command
def calibrate(
    output: Output,
    campaign: CampaignNamed,
    model: str | None = typer.Option(
        None, help="proportional, affine, power, semilog.", autocompletion=complete_model
    ),
    tolerance: float | None = typer.Option(None, help="Largest accepted error of L: 0.04 is 4 %."),
    exclude: list[str] | None = typer.Option(
        None, metavar="FRAME=REASON", help="Exclude a frame; repeatable."
    ),
    option: list[str] | None = typer.Option(
        None, "--set", metavar="NAME=VALUE", help="Any other parameter of the method; repeatable."
    ),
) -> None:
    """Fit a campaign and show the draft. It has no effect until it is published."""
    if tolerance is not None and not 0.0 < tolerance < 1.0:
        raise typer.BadParameter(f"--tolerance is a fraction: {tolerance / 100.0:g} for {tolerance:g} %")
    said: dict[str, Any] = {name: _value(text) for name, text in map(_pair, option or ())}
    said |= without_none({"model": model, "tolerance": tolerance})
    with output.client() as client:
        campaign_id = client.find_campaign(campaign).id
        if exclude:
            names, reasons = zip(*(_pair(each, "FRAME=REASON") for each in exclude), strict=True)
            ids = _find_frames(client, campaign_id, names, "--exclude")
            said["exclude"] = [
                {"frame_id": each, "reason": reason} for each, reason in zip(ids, reasons, strict=True)
            ]
        with showing(output.err) as listener:
            read = partial(listener.on_count, "read")
            calibration = client.calibrate(campaign_id, on_progress=read, **said)
    output.answer(calibration.raw, *format_calibration(calibration))


@command
def publish(
    output: Output,
    calibration: CalibrationId,
    reason: str = typer.Option(..., help="Reason, for the record."),
    valid_from: str = typer.Option(..., "--from", help="In force from: a day, a time, or now."),
    valid_to: str | None = typer.Option(None, "--to", help="In force until; default: until it is replaced."),
    *,
    dry_run: bool = typer.Option(False, "--dry-run", help="Only show what it would change."),
) -> None:
    """Publish a version after showing what it changes."""
    # now is the service's, whose clock says what is in force: a laptop's may be days off
    asked, end = None if valid_from == "now" else read_moment(valid_from), read_moment(valid_to)
    with output.client() as client:
        impact = client.impact(calibration, at=asked)
        start = asked or f"{impact['at'][:19]}Z"
        if dry_run:
            output.answer(impact, *format_impact(impact), *_format_gaps(impact))
            return
        for line in format_impact(impact):
            output.note(line)
        found = client.publish(calibration, valid_from=start, valid_to=end, reason=reason)
    until = f" to {end}" if end else " on"
    output.answer(
        found.raw, *_format_gaps(found.raw), f"version {found.version} is in force from {start}{until}"
    )


@command
def revoke(
    output: Output,
    calibration: CalibrationId,
    reason: str = typer.Option(..., help="Reason, for the record."),
) -> None:
    """Take a version out of force permanently.

    What was measured with it is listed. Nothing takes its place: that time has no version in force.
    """
    with output.client() as client:
        found = client.revoke(calibration, reason=reason)
    touched = [each["measurement_id"] for each in found["measurements"]]
    roads = [f"{each['name']}, {each['link']}" for each in found.get("roads", ())]
    shown = [f"measured with it: {each}" for each in touched + roads]
    count = f"{counted(len(touched), 'measurement')} and {counted(len(roads), 'road')}"
    output.answer(found, *shown, f"{calibration} is revoked; measured with it: {count}")


@command
def history(
    output: Output,
    camera: str = typer.Argument(..., help="Its id or serial number.", autocompletion=complete_camera),
    method: str | None = typer.Option(None, help="Only of this method."),
) -> None:
    """List a camera's versions and when each is in force."""
    with output.client() as client:
        found = list(client.history(client.find_camera(camera).id, method=method))
    rows = [
        (
            *(each.method, each.version or "", each.state),
            *(at.isoformat().replace("+00:00", "Z") if at else "" for at in (each.valid_from, each.valid_to)),
            each.id,
        )
        for each in found
    ]
    columns = ("method", "version", "state", "in force from", "to", "calibration")
    output.answer({"items": [each.raw for each in found]}, table(columns, rows))


@command
def export(
    output: Output,
    calibration: str = typer.Argument(..., metavar="ID", help="Of a calibration version."),
    folder: Path = typer.Argument(..., metavar="FOLDER", help="Created if it does not exist."),
    *,
    measurement: bool = typer.Option(False, help="ID is that of a measurement."),
) -> None:
    """Download everything that a version depends on.

    Its certificate, readings, regions and every frame; of a measurement its record, frames and map.
    """

    def tell(progress: ExportProgress) -> None:
        output.note(f"{progress.files_done}/{progress.files_total} {progress.filename}")

    with output.client() as client:
        if measurement:
            client.export_measurement(calibration, folder)
        else:
            client.export(calibration, folder, on_progress=tell)
    output.answer({"folder": str(folder)}, str(folder))


def format_calibration(calibration: Calibration) -> list[RenderableType]:
    shown: list[RenderableType] = [of_coefficients(calibration.coefficients)]
    shown.append(f"{calibration.id}: version {calibration.version}, {calibration.state}")
    shown += format_findings(calibration.raw.get("findings", ()))
    if calibration.state == "draft":
        suggested = calibration.raw.get("suggested_validity", {"valid_from": "now"})
        until = f" --to {write_moment(suggested['valid_to'])}" if "valid_to" in suggested else ""
        start = write_moment(suggested["valid_from"])
        shown.append(f'Put it in force: stilb publish {calibration.id} --from {start}{until} --reason "..."')
    return shown


def read_polygon(text: str, *, option: str = "--polygon") -> list[tuple[float, float]]:
    corners = [_POINT.fullmatch(each) for each in text.split()]
    if len(corners) < 3 or None in corners:
        raise typer.BadParameter(f'{option} needs three corners or more: "x,y x,y x,y"')
    return [(float(corner[1]), float(corner[2])) for corner in corners if corner]


def set_regions(client: Client, campaign_id: str, path: Path | None) -> None:
    """Set regions of single frames from a table, if there is one: lines of a frame and its corners."""
    if path is None:
        return
    drawn: dict[str, list[tuple[float, float]]] = {}
    for line in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()):
        if not any(map(str.strip, line)) or line[0].strip().lower() == "frame":
            continue
        if len(line) != 2:
            message = f'--regions: {",".join(line)!r} is not a line such as DJI_1.DNG,"x,y x,y x,y"'
            raise typer.BadParameter(message)
        drawn[line[0].strip()] = read_polygon(line[1], option=f"--regions: {line[0]}")
    for frame_id, polygon in zip(
        _find_frames(client, campaign_id, list(drawn), "--regions"), drawn.values(), strict=True
    ):
        client.set_frame_roi(frame_id, polygon)


def format_impact(impact: dict[str, Any]) -> list[str]:
    changes = [
        f"{holds_for(row)}: {row['change']['value']:+.2f} ± {row['change']['standard_uncertainty']:.2f} %"
        for row in impact["coefficients"]
        if "change" in row
    ]
    for sign, key in (("gains", "isos_gained"), ("loses", "isos_lost")):
        if isos := impact[key]:
            changes.append(f"{sign} ISO {', '.join(f'{iso:g}' for iso in isos)}")
    if touched := len(impact["measurements"]):
        changes.append(f"made with the version in force: {counted(touched, 'measurement')}")
    return [impact["said"], *changes]


def _format_gaps(answer: dict[str, Any]) -> list[str]:
    return [f"the certificate lacks: {gap['message']}" for gap in answer.get("warnings", ())]


def _find_frames(client: Client, campaign_id: str, names: Sequence[str], option: str) -> list[str]:
    frames = list(client.frames(campaign_id))
    found = []
    for name in names:
        fitting = [frame.id for frame in frames if name in {frame.id, frame.filename}]
        if len(fitting) != 1:
            how_many = f"{len(fitting)} frames are" if fitting else "no frame is"
            alike = get_close_matches(name, {frame.filename for frame in frames}, n=1)
            meant = f"; did you mean {alike[0]!r}?" if alike and not fitting else ""
            raise typer.BadParameter(f"{option}: {how_many} called {name!r} here{meant}")
        found += fitting
    return found


def _pair(text: str, shape: str = "NAME=VALUE") -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not (name and sign and value):
        raise typer.BadParameter(f"{text!r} must be written as {shape}")
    return name, value


def _value(text: str) -> object:
    """A number, a list, true or false as JSON has them; anything else is a text."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def _text_or_file(text: str) -> str:
    if "(" in text:
        return text
    try:
        return read_macro(Path(text))
    except FileNotFoundError:
        raise Unclear(f"{text!r} is neither makePolygon(...) nor an existing file") from None


@command
def k(
    output: Output,
    camera: str = typer.Argument(
        ..., metavar="CAMERA", help="Its id or serial number.", autocompletion=complete_camera
    ),
    method: str = typer.Option(
        DEFAULT_METHOD, help="Method of the coefficients.", autocompletion=complete_method
    ),
    iso: float | None = typer.Option(None, help="Only this ISO value."),
    f_number: float | None = typer.Option(None, help="At this f-number; default: in general."),
    at: str | None = typer.Option(None, help="In force at this time; default: now."),
    known_at: str | None = typer.Option(None, help="As known at this time; default: now."),
) -> None:
    """Show the K in force of a camera, with its uncertainty.

    And where it comes from. Of another method: every coefficient that is in force.
    """
    name = read_methods()[method]["coefficients"][0]["name"] if method == DEFAULT_METHOD else None
    asked: dict[str, Any] = {"name": name, "known_at": read_moment(known_at)}
    asked["at"] = None if at == "now" else read_moment(at)
    with output.client() as client:
        camera_id = client.find_camera(camera).id
        found = client.coefficients(camera_id, method=method, iso=iso, f_number=f_number, **asked)
    why = dict.fromkeys(row.why for row in found if row.why)
    output.answer({"items": [row.raw for row in found]}, of_coefficients(found), *why)


@command
def fleet(
    output: Output,
    method: str = typer.Argument(..., metavar="METHOD", autocompletion=complete_method),
    cameras: list[str] = typer.Argument(..., metavar="CAMERA...", help="Ids or serial numbers."),
    tolerance: float = typer.Option(
        ..., help="Largest accepted deviation: 0.04 is 4 %; of geometry, in pixels."
    ),
) -> None:
    """Show whether cameras of a model can share coefficients.

    And at what cost. From the published versions of each: several campaigns of a camera show how well it
    repeats.
    """
    with output.client() as client:
        ids = [client.find_camera(each).id for each in cameras]
        found = client.fleet_verdict(method, ids, tolerance=tolerance)
    output.answer(found, _lay_out(found["parameters"]), found["said"])


def _lay_out(parameters: list[dict[str, Any]]) -> Table:
    return table(
        ("parameter", "shared value", "cost of sharing", "verdict"),
        [
            (
                holds_for(row),
                figure(Quantity(**row["mean"])),
                f"{row['cost']['value']:.3g} {row['cost']['unit']}" if "cost" in row else "",
                row["verdict"].replace("_", " "),
            )
            for row in parameters
        ],
    )


_NUMBERS = ("yaw", "pitch", "roll", "x", "y", "z")


@command
def rig(
    output: Output,
    name: str = typer.Argument(..., metavar="RIG", help="Its name or id."),
    camera: list[str] | None = typer.Option(
        None, help="Register the rig with this camera, by id or serial number; repeated, the reference first."
    ),
    tolerance_deg: float | None = typer.Option(
        None, metavar="DEG", help="Largest accepted change of an angle over all sets."
    ),
    tolerance_m: float | None = typer.Option(
        None, metavar="M", help="Largest accepted change of a place over all sets."
    ),
    save: Path | None = typer.Option(
        None, metavar="FILE", help="Save it; the name says as what: opencv.yaml or rig.json."
    ),
) -> None:
    """Show how the cameras of a rig are oriented.

    From board pictures that its cameras took together, and whether it is stable over several sets of them.
    With --camera the rig is registered first.
    """
    with output.client() as client:
        cameras = [client.find_camera(each).id for each in camera or ()]
        found = client.create_rig(name, cameras) if cameras else client.find_rig(name)
        answer = client.rig_orientation(found.id, tolerance_deg=tolerance_deg, tolerance_m=tolerance_m)
        if save:
            client.save_rig(found.id, save)
    output.answer(answer, show_rig(answer), *list_reasons(answer))


def show_rig(answer: dict[str, Any]) -> Any:  # noqa: ANN401
    """The newest orientation, number by number."""
    verdicts = {(row["camera"], row["name"]): row["verdict"] for row in answer["stability"]}
    newest = answer["sets"][-1]["orientation"]["poses"] if answer["sets"] else []
    return table(
        ("camera", "number", "value", "stability"),
        [
            (
                *(pose["camera"], name, figure(Quantity(**pose[name]))),
                verdicts[pose["camera"], name].replace("_", " "),
            )
            for pose in newest
            for name in _NUMBERS
        ],
    )


def list_reasons(answer: dict[str, Any]) -> list[str]:
    """Flags of all sets, and the versions that are in none."""
    flags = [flag for each in answer["sets"] for flag in each["orientation"]["flags"]]
    said = [f"{flag['flag']}: {flag['where']} {flag['detail']}".replace("  ", " ") for flag in flags]
    return said + [f"{each['calibration_id']}: {each['why']}" for each in answer["left_out"]]

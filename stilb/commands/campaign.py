"""Commands on a campaign in a folder: init, run, list, show, readings, points."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import typer
from rich.console import RenderableType

from stilb.client import Client
from stilb.commands.calibration import format_calibration
from stilb.commands.measurements import format_measurements
from stilb.commands.output import CampaignNamed, Exit, Output, command
from stilb.commands.push import Folder, add_unread, place, transfer
from stilb.commands.terminal import counted, format_findings, lines, showing, table
from stilb.field import plan as plans
from stilb.field.files import ANY_RULES, find_method, quote, read_camera, sort_files
from stilb.field.push import Report, as_json
from stilb.field.template import LAMP_HELP, read_methods, write_template
from stilb.problem import Problem, Unclear
from stilb.records import DEFAULT_METHOD
from stilb.transport import write_whole

app = typer.Typer(help="A campaign in a folder: camera, meter, readings and frames.", no_args_is_help=True)


@app.command("init", epilog="Example: stilb campaign init card --project P-17")
@command
def init(  # noqa: PLR0913, PLR0917 (the command's options)
    output: Output,
    folder: Path = typer.Argument(Path(), metavar="[FOLDER]", exists=True, file_okay=False),
    make: str = typer.Option("", help="Of the camera; default: as its files state it."),
    model: str = typer.Option("", help="Of the camera; default: as its files state it."),
    serial: str = typer.Option("", help="Of the camera; default: as its files state it."),
    method: str | None = typer.Option(None, help="Method; default: what the service proposes for the files."),
    project: str | None = typer.Option(None, help="Project number; default: the folder's name."),
    lamp: str | None = typer.Option(None, metavar="KIND", help=LAMP_HELP),
    mains: float | None = typer.Option(
        None, help="Mains frequency of the lamps in Hz; 0 for direct current."
    ),
    *,
    night: bool = typer.Option(False, "--night", help="A night of measurements, not a calibration."),
) -> None:
    """Write a campaign.toml to fill in. An existing file is kept."""
    if method not in {None, *read_methods()}:
        raise typer.BadParameter(f"--method is one of {', '.join(read_methods())}")
    light = {"lamp_kind": lamp, "mains_frequency_hz": mains}
    is_lit = any(each is not None for each in light.values())
    if is_lit and method not in {None, DEFAULT_METHOD}:
        raise typer.BadParameter(f"--lamp and --mains are of {DEFAULT_METHOD} campaigns")
    path = folder / plans.FILENAME
    if path.exists():
        raise Unclear(f"{path} exists already: edit it, or remove it first")
    method = method or (DEFAULT_METHOD if is_lit else _propose_method(output, folder, night=night))
    said = {"make": make, "model": model, "serial": serial, "method": method}
    said["project_number"] = project or folder.resolve().name
    stated = read_camera(folder)
    said |= {name: said[name] or stated.get(name, "") for name in ("make", "model", "serial")}
    text = write_template(
        said, folder=quote(folder), has_readings=(folder / "readings.csv").exists(), night=night, light=light
    )
    write_whole(path, text)
    output.answer({"path": str(path)}, f"Fill in {path}, then: stilb campaign run {quote(folder)}")


def _propose_method(output: Output, folder: Path, *, night: bool) -> str:
    """Return the method that the service proposes for the files, else the usual one; tell which, and why."""
    files, _ = sort_files(folder, ANY_RULES, raw_only=True)
    try:
        with output.client(retries=0) as client:
            proposed = find_method(client, folder, files, **({"kind": "measurement"} if night else {}))
        why = "no file states its exposure"
    except (Problem, Unclear) as error:
        proposed, why = None, str(error).rstrip(".")
    reason = "as the files suggest" if proposed else f"which is assumed ({why})"
    output.note(f"method {proposed or DEFAULT_METHOD}, {reason}; for another: --method")
    return proposed or DEFAULT_METHOD


@app.command("run", epilog="Example: stilb campaign run card")
@command
def run(
    output: Output,
    folder: Folder,
    *,
    fit: bool = typer.Option(
        True, "--fit/--no-fit", help="Fit, or measure a night, when all frames are read."
    ),
    replace_readings: bool = typer.Option(
        False, "--replace-readings", help="Withdraw readings that are not in the folder."
    ),
) -> None:
    """Run a campaign from card to draft, as in campaign.toml.

    Camera, campaign, region, readings, frames, fit; of a night of measurements: frames, measurements. The
    same command again goes on where it was; what has been done is not done twice.
    """
    plan = plans.read_plan(folder)
    files, left_out = sort_files(folder, plan.rules or ANY_RULES)
    with output.client() as client:
        if plan.method == DEFAULT_METHOD and not plan.rules and not plans.find_planned(client, plan):
            suited = find_method(client, folder, files)
            if suited not in {None, plan.method}:
                output.note(
                    f"these files look like a {suited} campaign, and {plans.FILENAME} states {plan.method}: "
                    f"to change it, press Ctrl-C, remove it, and stilb campaign init --method {suited}"
                )
        campaign = plans.ensure_campaign(client, plan)
        output.note(f"campaign {campaign.id}, {plan.project_number}")
        count, others = plans.ensure_readings(client, plan, campaign.id)
        output.note(f"readings: {count}")
        _settle(output, client, others, replace=replace_readings)
    unread: list[str] = []
    if not plan.rules:
        files, unread = place(output, folder, files, campaign_id=campaign.id)
    report = transfer(output, folder, campaign.id, files, left_out=left_out, attest=not unread)
    report = add_unread(report, unread)
    if not fit:
        _end(output, report, {}, [])
        return
    if not output.as_json:
        output.note("\n".join(lines(report)))
    with output.client() as client:
        if campaign.kind == "measurement":
            with showing(output.err) as listener:
                found, refused = client.measure_campaign(
                    campaign.id, on_progress=partial(listener.on_count, "measured"), **plan.measure
                )
            _end(
                output,
                report,
                {"measurements": [one.raw for one in found], "not_measured": refused},
                format_measurements(found, refused),
            )
            return
        plans.ensure_panel(client, plan, campaign.id)
        with showing(output.err) as listener:
            read = partial(listener.on_count, "read")
            calibration = client.calibrate(campaign.id, on_progress=read, **plans.list_parameters(plan))
    _end(output, report, {"calibration": calibration.raw}, format_calibration(calibration))


@app.command("list", epilog="Example: stilb campaign list")
@command
def list_campaigns(output: Output) -> None:
    """List the campaigns of your organisation, oldest first."""
    with output.client() as client:
        found = list(client.campaigns())
        cameras = {one.id: f"{one.make} {one.model} {one.serial}" for one in client.cameras()}
    rows = [
        (one.project_number or "", one.method, one.kind, cameras.get(one.camera_id, one.camera_id), one.id)
        for one in found
    ]
    shown = table(("project number", "method", "kind", "camera", "campaign"), rows)
    output.answer({"items": [one.raw for one in found]}, shown)


@app.command("show", epilog="Example: stilb campaign show P-17")
@command
def show(output: Output, campaign: CampaignNamed) -> None:
    """Show received frames, missing items and advice."""
    with output.client() as client:
        found = client.campaign(client.find_campaign(campaign).id).raw
    frames, offered = found["frames"], found.get("panel_offered")
    night = found.get("kind") == "measurement"
    told = f"{found['measured']} measured" if night else counted(found["readings"], "reading")
    ready = f"ready: stilb {'measure --campaign' if night else 'calibrate'} {campaign}"
    output.answer(
        found,
        f"{found['id']} {found.get('project_number', '')} {found['method']}",
        f"{counted(frames['received'], 'frame')}, {frames['extracted']} extracted, {frames['refused']} "
        f"refused; {told}",
        *([f"missing: {each}" for each in found["missing"]] or [ready]),
        *(f"advice: {each}" for each in found["advice"]),
        *format_findings(found["findings"]),
        *([f"the frames show panel {offered['serial']}: stilb campaign panel {campaign}"] if offered else []),
    )


@app.command("panel", epilog="Example: stilb campaign panel P-17 --serial RP04-1832179-SC")
@command
def panel(
    output: Output,
    campaign: CampaignNamed,
    serial: str | None = typer.Option(None, help="Serial number; default: the panel that the frames name."),
) -> None:
    """Name the panel that the frames show.

    A panel that is not registered is registered with the reflectances that its files or its code state.
    """
    with output.client() as client:
        found = client.campaign(client.find_campaign(campaign).id)
        named = serial or (found.raw.get("panel_offered") or {}).get("serial")
        if named is None:
            raise Unclear("The frames name no other panel than the campaign's. Name one with --serial.")
        changed = client.change_campaign(found.id, panel_serial=named)
        bands = client.panel(changed.raw["panel_id"]).raw["bands"]
    rows = [
        (each["band"], f"{each['reflectance']:.4g}", "file" if each.get("origin") else "measured")
        for each in bands
    ]
    output.answer(changed.raw, f"panel {named}", table(("band", "reflectance", "from"), rows))


@app.command("readings", epilog="Example: stilb campaign readings P-17 readings.csv")
@command
def readings(
    output: Output,
    campaign: CampaignNamed,
    spreadsheet: Path = typer.Argument(
        ..., metavar="FILE.csv", exists=True, dir_okay=False, help="scene,quantity,value,unit,reason"
    ),
    meter: list[str] | None = typer.Option(None, help="Id of the meter; repeatable."),
) -> None:
    """Send a spreadsheet of readings. The service converts units and reports invalid rows by line."""
    text = plans.read_spreadsheet(spreadsheet)
    with output.client() as client:
        added = client.add_readings(client.find_campaign(campaign).id, text, meter_ids=meter or ())
    rows = [(one["scene"], one["quantity"], f"{one['value']:.6g} {one['unit']}") for one in added]
    output.answer(
        {"items": added}, table(("scene", "quantity", "value"), rows), counted(len(added), "reading")
    )


@app.command("points", epilog="Example: stilb campaign points P-17 Results.csv --white-level-dn 4095")
@command
def points(
    output: Output,
    campaign: CampaignNamed,
    spreadsheet: Path = typer.Argument(
        ..., metavar="FILE.csv", exists=True, dir_okay=False, help="As ImageJ's Results."
    ),
    white_level_dn: float = typer.Option(..., help="Where the sensor clips: 255 of 8 bits."),
    black_level_dn: float | None = typer.Option(None, help="Default: unknown."),
    exposure_time_s: float | None = typer.Option(None, help="Of rows that state none."),
    f_number: float | None = typer.Option(None, help="Of rows that state none."),
    iso: float | None = typer.Option(None, help="Of rows that state none."),
) -> None:
    """Send a table of statistics in the place of raw frames."""
    text = plans.read_spreadsheet(spreadsheet)
    stated: dict[str, Any] = {"exposure_time_s": exposure_time_s, "f_number": f_number, "iso": iso}
    stated["black_level_dn"] = black_level_dn
    with output.client() as client:
        campaign_id = client.find_campaign(campaign).id
        added = client.add_points(campaign_id, text, white_level_dn=white_level_dn, **stated)
    ignored = ", ".join(added["ignored_columns"])
    more = [f"columns that were not read: {ignored}"] if ignored else []
    output.answer(added, counted(len(added["items"]), "frame"), *more)


def _settle(output: Output, client: Client, others: list[str], *, replace: bool) -> None:
    """Readings that are not the folder's: typed on the page, or of a spreadsheet that was corrected since."""
    if others and replace:
        for reading_id in others:
            client.withdraw_reading(reading_id)
        output.note(f"withdrawn: {counted(len(others), 'other reading')}")
    elif others:
        output.note(
            f"Of the campaign's readings {len(others)} of those that count are not in the folder. If the "
            "folder's are to replace them, run this again with --replace-readings"
        )


def _end(output: Output, report: Report, more: dict[str, object], shown: Sequence[RenderableType]) -> None:
    output.answer({**as_json(report), **more}, *(lines(report) if not more else ()), *shown)
    if not report.is_well or more.get("not_measured"):
        raise typer.Exit(Exit.FINDINGS)


_WORDS = {True: "within", False: "BEYOND", None: "unknown"}
_BLURS = ("rotation_rate_deg_s", "rotation_blur_px", "forward_blur_px", "theoretical_blur_px")


@command
def motion(
    output: Output,
    campaign: CampaignNamed,
    focal_length: float = typer.Option(..., metavar="MM", help="Focal length of the lens [mm]."),
    pixel_pitch: float | None = typer.Option(
        None, metavar="UM", help="Pixel pitch [um]; default: the camera's."
    ),
    limit: float | None = typer.Option(None, metavar="PX", help="Largest tolerable motion; default: 0.5 px."),
    speed: float | None = typer.Option(None, metavar="M/S", help="Speed over ground; with --height."),
    height: float | None = typer.Option(None, metavar="M", help="Height above ground; with --speed."),
    role: str | None = typer.Option(None, help="Only frames of this role, such as field."),
) -> None:
    """Show the image motion in each frame.

    From the attitudes that the files of a campaign record, and from the speed over ground where it is given.
    """
    stated: dict[str, Any] = {"pixel_pitch_um": pixel_pitch, "limit_px": limit}
    stated |= {"ground_speed_m_s": speed, "distance_m": height}
    with output.client() as client:
        campaign_id = client.find_campaign(campaign).id
        found = client.motion(campaign_id, focal_length_mm=focal_length, role=role, **stated)
    judged = f"{found['within_limit']} within {found['limit_px']:g} px, {found['beyond_limit']} beyond"
    sentence = f"{counted(found['frames'], 'frame')}, {found['with_rates']} with rates: {judged}"
    output.answer(found, _table(found["rows"]), *_reasons(found["rows"]), sentence)
    if found["beyond_limit"]:
        raise typer.Exit(Exit.FINDINGS)


def _table(rows: list[dict[str, Any]]) -> Any:  # noqa: ANN401
    return table(
        ("file", "role", "deg/s", "rotation px", "forward px", "together px", "limit"),
        [
            (
                row["filename"],
                row["role"],
                *(f"{row[name]:.3g}" if name in row else "" for name in _BLURS),
                _WORDS[row.get("within_limit")],
            )
            for row in rows
        ],
    )


def _reasons(rows: list[dict[str, Any]]) -> list[str]:
    """Each reason once, with the first of its files: a camera without records has one for all."""
    files: dict[str, list[str]] = {}
    for row in rows:
        if "missing" in row:
            files.setdefault(row["missing"], []).append(row["filename"])
    return [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {why}"
        for why, names in files.items()
    ]

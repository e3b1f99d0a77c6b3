"""Measurements of field frames in physical units."""

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from stilb.commands.calibration import read_polygon
from stilb.commands.exits import Exit
from stilb.commands.output import Output, command
from stilb.commands.tables import figure, table
from stilb.records import Grid, MeasureDetails, Measurement

_GRID = re.compile(r"(\d+)x(\d+)")


@command
def measure(  # noqa: PLR0913, PLR0917 (the command's options)
    output: Output,
    frames: Annotated[list[str] | None, typer.Argument(metavar="[FRAME]...", help="Ids of frames.")] = None,
    campaign: Annotated[str | None, typer.Option(help="All field frames of this campaign.")] = None,
    calibration: Annotated[
        str | None, typer.Option(help="Default: in force at the time of the frame.")
    ] = None,
    region: Annotated[
        str | None,
        typer.Option(help="Region \"x,y x,y x,y ...\"; default: --grid, the frame's own, its campaign's."),
    ] = None,
    grid: Annotated[
        str | None, typer.Option(help='A surface: "3x5 x,y x,y x,y x,y", rows x columns.')
    ] = None,
    reflectance: Annotated[
        float | None, typer.Option(help="Reflectance of the surface, for its illuminance.")
    ] = None,
    index: Annotated[str | None, typer.Option(help="For a near infrared frame: ndvi, ndre or gndvi.")] = None,
    allow: Annotated[
        list[str] | None,
        typer.Option(metavar="FLAG", help="Measure frames despite this flag: image_part_empty."),
    ] = None,
    save_map: Annotated[
        Path | None, typer.Option("--map", metavar="FOLDER", help="Save a map of each frame in this folder.")
    ] = None,
    *,
    average: Annotated[
        bool, typer.Option("--average", help="Average the frames: repeats of one scene.")
    ] = False,
) -> None:
    """Measure frames with a calibrated camera."""
    if bool(frames) == (campaign is not None):
        raise typer.BadParameter("give frames, or --campaign")
    if average and len(frames or ()) < 2:
        raise typer.BadParameter("--average needs two frames or more")
    details = _details(calibration, region, grid, reflectance)
    if index is not None:
        details["index"] = index
    if allow:
        details["allow"] = list(allow)
    refused: list[dict[str, Any]] = []
    with output.client() as client:
        with_map = save_map is not None
        if campaign is not None:
            campaign_id = client.find_campaign(campaign).id
            found, refused = client.measure_campaign(campaign_id, with_map=with_map, **details)
        else:
            asked = [frames or []] if average else frames or []
            found = [client.measure(each, with_map=with_map, **details) for each in asked]
        if save_map is not None:
            save_map.mkdir(parents=True, exist_ok=True)
            for one in found:
                output.note(str(client.save_map(one.id, save_map / f"{one.id}.tif")))
    told = {"items": [one.raw for one in found], "not_measured": refused}
    output.answer(
        told, _table(found), *(f"{each['filename']} not measured: {each['detail']}" for each in refused)
    )
    if refused:
        raise typer.Exit(Exit.FINDINGS)


@command
def compare(
    output: Output,
    old: Annotated[str, typer.Argument(help="Id of the older measurement.")],
    new: Annotated[str, typer.Argument(help="Id of the newer measurement.")],
    *,
    other_region: Annotated[
        bool, typer.Option("--other-region", help="Compare even if their outlines in the image differ.")
    ] = False,
) -> None:
    """Compare two measurements of the same outline."""
    with output.client() as client:
        found = client.compare(old, new, other_region=other_region)
    change = f" ({figure(found.change)})" if found.change else ""
    output.answer(found.raw, found.said, f"new - old: {figure(found.difference)}{change}")


def _details(
    calibration: str | None, region: str | None, grid: str | None, reflectance: float | None
) -> MeasureDetails:
    details = MeasureDetails()
    if calibration is not None:
        details["calibration_id"] = calibration
    if region is not None:
        details["polygon"] = read_polygon(region)
    if grid is not None:
        details["grid"] = _read_grid(grid)
    if reflectance is not None:
        details["reflectance"] = reflectance
    return details


def _read_grid(text: str) -> Grid:
    size, _, corners = text.partition(" ")
    found = _GRID.fullmatch(size)
    if found is None or len(corners.split()) != 4:
        raise typer.BadParameter('--grid needs rows x columns and four corners: "3x5 x,y x,y x,y x,y"')
    return Grid(corners=read_polygon(corners), rows=int(found[1]), columns=int(found[2]))


def _table(found: list[Measurement]) -> Any:  # noqa: ANN401
    return table(
        ("measurement", "file", "mean", "region", "U_o", "flags"),
        [
            (
                one.id,
                one.filename + (f" and {len(one.frame_ids) - 1} more" if one.frame_ids else ""),
                figure(one.mean) if one.mean else "",
                one.region_origin.replace("_", " "),
                f"{one.u_o.value:.3f}" if one.u_o else "",
                " ".join(dict.fromkeys(one.flags)),
            )
            for one in found
        ],
    )

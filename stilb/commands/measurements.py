"""Measurements of field frames in physical units."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, cast

import typer
from rich.console import RenderableType

from stilb.client import Client
from stilb.commands import push, terminal
from stilb.commands.calibration import read_polygon, set_regions
from stilb.commands.output import Exit, Output, command, complete_campaign
from stilb.field import files, plan, template
from stilb.records import Grid, Measurement
from stilb.resources.measurements import Area
from stilb.transport import without_none

_GRID = re.compile(r"(\d+)x(\d+)")


@command
def measure(  # noqa: PLR0913, PLR0917 (the command's options)
    output: Output,
    frames: list[str] | None = typer.Argument(
        None, metavar="[FRAME]...|FOLDER", help="Ids of frames, or a folder to send and measure."
    ),
    campaign: str | None = typer.Option(
        None,
        help="All field frames of this campaign, or that of the folder.",
        autocompletion=complete_campaign,
    ),
    calibration: str | None = typer.Option(None, help="Default: in force at the time of the frame."),
    region: str | None = typer.Option(
        None, help="Region \"x,y x,y x,y ...\"; default: --grid, the frame's own, its campaign's."
    ),
    regions: Path | None = typer.Option(
        None, metavar="FILE.csv", help='Regions of frames, kept: lines of frame,"x,y x,y x,y".'
    ),
    grid: str | None = typer.Option(None, help='A surface: "3x5 x,y x,y x,y x,y", rows x columns.'),
    lanes: str | None = typer.Option(
        None, help='Lanes of EN 13201-3: "2x3.5x30 x,y x,y x,y x,y", lanes x width x spacing in m.'
    ),
    reflectance: float | None = typer.Option(None, help="Reflectance of the surface, for its illuminance."),
    reflectance_u: float | None = typer.Option(None, help="Its relative standard uncertainty; default: 0.1."),
    light: str | None = typer.Option(
        None, metavar="NAME|FILE.csv", help="Light source: a lamp of the library, or its spectrum."
    ),
    distance: float | None = typer.Option(None, help="To the surface, in m."),
    focus: str | None = typer.Option(None, help="surface (default), or unchanged since the calibration."),
    lamp: str | None = typer.Option(
        None, metavar="KIND", help=f"{template.LAMP_HELP} Default: the campaign's."
    ),
    mains: float | None = typer.Option(
        None, help="Mains frequency in Hz, 0 for direct current; default: the campaign's."
    ),
    modulation: float | None = typer.Option(None, help="Modulation depth of the light, 0 to 1."),
    glare: float | None = typer.Option(None, help="Glare of a black trap over the frame's mean."),
    mismatch: float | None = typer.Option(
        None, help="Standard uncertainty of L from the spectrum; default: estimated."
    ),
    index: str | None = typer.Option(
        None, help='ndvi, ndre, gndvi, evi2, savi, or a formula: "(nir - red) / (nir + red)".'
    ),
    quantity: str | None = typer.Option(None, help="Of a band: reflectance, or radiance in W/(m2 sr nm)."),
    height: float | None = typer.Option(
        None, help="Of the camera above level ground, in m: places maps of bands."
    ),
    ground: float | None = typer.Option(None, help="Altitude of the ground in m, in place of --height."),
    height_u: float | None = typer.Option(None, help="Standard uncertainty of the height, in m."),
    allow: list[str] | None = typer.Option(
        None, metavar="FLAG", help="Measure frames despite this flag: image_part_empty."
    ),
    save_map: Path | None = typer.Option(
        None, "--map", metavar="FOLDER", help="Save a map of each frame in this folder."
    ),
    save_cells: Path | None = typer.Option(
        None, "--cells", metavar="FOLDER", help="Save cells as CSV and GeoJSON."
    ),
    save_report: Path | None = typer.Option(
        None, "--report", metavar="FOLDER", help="Save a two-page report (PDF) of each luminance."
    ),
    save: Path | None = typer.Option(
        None, metavar="FILE", help="Save all of the campaign: .csv, .geojson or .json."
    ),
    *,
    bands: bool = typer.Option(
        False, "--bands", help="With --map: all bands of the capture, aligned, in one file."
    ),
    stac: bool = typer.Option(False, "--stac", help="With --map: a STAC item beside each map."),
    average: bool = typer.Option(False, "--average", help="Average the frames: repeats of one scene."),
) -> None:
    """Measure frames with a calibrated camera.

    Of a folder every raw file is sent as a field frame to --campaign, or to the night of its campaign.toml,
    and all field frames of that campaign are measured.
    """
    folder = _find_folder(frames or [], campaign, {"--save": save, "--regions": regions})
    if (bands or stac) and save_map is None:
        raise typer.BadParameter("--bands and --stac need --map FOLDER")
    if average and len(frames or ()) < 2:
        raise typer.BadParameter("--average needs two frames or more")
    if light is not None and light.lower().endswith(".csv"):
        light = plan.read_spreadsheet(Path(light))
    if region is not None and regions is not None:
        raise typer.BadParameter("give either --region for all, or --regions for each")
    outlines = _read_lanes(lanes) if lanes is not None else None if grid is None else _read_grid(grid)
    polygon = None if region is None else read_polygon(region, option="--region")
    given: dict[str, Any] = {"calibration_id": calibration, "polygon": polygon, "grid": outlines}
    given |= {"reflectance": reflectance, "reflectance_u_rel": reflectance_u, "light_source": light}
    given |= {"distance_m": distance, "lens_focus": focus, "mains_frequency_hz": mains, "lamp_kind": lamp}
    given |= {"lamp_modulation": modulation, "glare_share": glare, "spectral_mismatch_u_rel": mismatch}
    given |= {"index": index, "quantity": quantity, "height_above_ground_m": height, "height_u_m": height_u}
    given |= {"ground_altitude_m": ground, "allow": allow or None}
    details = without_none(given)
    refused: list[dict[str, Any]] = []
    sent = None if folder is None else push.send_night(output, folder, campaign)
    with output.client() as client, terminal.showing(output.err) as listener:
        wanted: dict[str, Any] = {"with_map": save_map is not None, "with_bands": bands}
        if sent is not None or campaign is not None:
            campaign_id = sent.campaign_id if sent else client.find_campaign(campaign or "").id
            set_regions(client, campaign_id, regions)
            wanted["on_progress"] = partial(listener.on_count, "measured")
            found, refused = client.measure_campaign(campaign_id, **wanted, **details)
            if save is not None:
                output.note(str(client.save_measurements(campaign_id, save)))
        else:
            asked = [frames or []] if average else frames or []
            found = [client.measure(each, **wanted, **details) for each in asked]
        gridded = [one for one in found if "grid" in one.raw]
        for suffix in ("csv", "geojson"):
            _save_each(output, gridded, save_cells, suffix, client.save_cells)
        luminances = [one for one in found if "seen_from" in one.raw]
        _save_each(output, luminances, save_report, "pdf", client.save_report)
        if save_map is not None:
            _save_maps(output, client, found, save_map, stac=stac)
    told = {"items": [one.raw for one in found], "not_measured": refused}
    output.answer(told, *format_measurements(found, refused))
    if refused or (sent is not None and not sent.is_well):
        raise typer.Exit(Exit.FINDINGS)


def _save_each(
    output: Output,
    found: list[Measurement],
    folder: Path | None,
    suffix: str,
    save: Callable[[str, Path], Path],
) -> None:
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for one in found:
        output.note(str(save(one.id, folder / f"{files.plain_stem(one.filename)}-{one.id}.{suffix}")))


def _save_maps(output: Output, client: Client, found: list[Measurement], folder: Path, *, stac: bool) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for one in found:
        path = client.save_map(one.id, folder / f"{files.plain_stem(one.filename)}-{one.id}.tif")
        output.note(f"{path} {one.raw.get('place', {}).get('detail', '')}".rstrip())
        if stac:
            output.note(str(client.save_stac(one.id, path)))


def _find_folder(
    frames: list[str], campaign: str | None, of_campaigns: Mapping[str, Path | None]
) -> Path | None:
    """Return the folder that is to be sent and measured, if it is one; refuse what does not go together."""
    if len(frames) == 1 and Path(frames[0]).is_dir():
        return Path(frames[0])
    if bool(frames) == (campaign is not None):
        raise typer.BadParameter("give the ids of frames, a folder to send, or --campaign")
    for option, value in of_campaigns.items():
        if value is not None and campaign is None:
            raise typer.BadParameter(f"{option} needs --campaign, or a folder")
    for frame in frames:
        _refuse_file(frame)
    return None


def _refuse_file(frame: str) -> None:
    """Refuse the name of a file in place of the id of a frame, and say how to get one."""
    path = Path(frame)
    if frame.startswith("frm_") or not (path.suffix or path.exists()):
        return
    raise typer.BadParameter(
        f"{frame} is {'a file' if path.exists() else 'the name of a file, which is not here,'} and not the "
        "id of a frame. Send and measure its folder: stilb measure FOLDER --campaign CAMPAIGN."
    )


@command
def compare(
    output: Output,
    old: str = typer.Argument(..., help="Id of the older measurement."),
    new: str = typer.Argument(..., help="Id of the newer measurement."),
    *,
    other_region: bool = typer.Option(
        False, "--other-region", help="Compare even if their outlines in the image differ."
    ),
    same_light: bool = typer.Option(
        False, "--same-light", help="The same lamps lit both: their spectral mismatch cancels."
    ),
) -> None:
    """Compare two measurements of the same outline."""
    with output.client() as client:
        found = client.compare(old, new, other_region=other_region, same_light=same_light)
    change = f" ({terminal.figure(found.change)})" if found.change else ""
    output.answer(found.raw, found.said, f"new - old: {terminal.figure(found.difference)}{change}")


def _read_grid(text: str) -> Grid:
    size, _, corners = text.partition(" ")
    if (found := _GRID.fullmatch(size)) is None or len(corners.split()) != 4:
        raise typer.BadParameter('--grid needs rows x columns and four corners: "3x5 x,y x,y x,y x,y"')
    return Grid(corners=read_polygon(corners), rows=int(found[1]), columns=int(found[2]))


def _read_lanes(text: str) -> Grid:
    """Read lanes x width x spacing, with the length of the rectangle where it is not the spacing."""
    size, _, corners = text.partition(" ")
    try:
        lanes, *sizes = size.split("x")
        width, spacing, *more = map(float, sizes)
        (length,) = more or (spacing,)
        _, _, _, _ = corners.split()
        said = Grid(corners=read_polygon(corners), lanes=int(lanes), lane_width_m=width, spacing_m=spacing)
    except ValueError as error:
        message = '--lanes needs lanes x width x spacing [x length] in m and four corners: "2x3.5x30 x,y ..."'
        raise typer.BadParameter(message) from error
    return said if length == spacing else Grid(**said, length_m=length)


def format_measurements(
    found: Sequence[Measurement], refused: Sequence[Mapping[str, Any]]
) -> list[RenderableType]:
    """Return a table of measurements, and the frames that were not measured, by their reasons."""
    shown = terminal.table(
        ("measurement", "file", "mean", "region", "U_o", "flags"),
        [
            (
                one.id,
                one.filename + (f" and {len(one.frame_ids) - 1} more" if one.frame_ids else ""),
                terminal.figure(one.mean) + terminal.show_scope(one.uncertainty_scope) if one.mean else "",
                one.region_origin.replace("_", " "),
                f"{one.u_o.value:.3f}" if one.u_o else "",
                " ".join(dict.fromkeys(one.flags)),
            )
            for one in found
        ],
    )
    views = dict.fromkeys(one.raw["seen_from_detail"] for one in found if "seen_from" in one.raw)
    alike = terminal.group_alike(refused, lambda each: [each["detail"].replace(each["filename"], "")])
    told = (
        (
            f"{terminal.name_some([each['filename'] for each in some], 'frames')}  not measured",
            f"    {some[0]['detail']}",
        )
        for some in alike
    )
    return [shown, *(f"seen from above: {view}" for view in views), *chain.from_iterable(told)]


@command
def read_map(
    output: Output,
    measurement: str = typer.Argument(..., help="Id of a measurement that was made with a map."),
    levels: str | None = typer.Option(None, help='Levels of isolines: "0.5,1,2"; default: round ones.'),
    area: str = typer.Option("frame", help="region, grid or frame."),
    save: Path = typer.Option(Path(), metavar="FOLDER", help="Where the file goes."),
) -> None:
    """Save the isolines of a map as GeoJSON."""
    if area not in {"region", "grid", "frame"}:
        raise typer.BadParameter("--area is region, grid or frame")
    numbers = None if levels is None else _read_levels(levels)
    save.mkdir(parents=True, exist_ok=True)
    path = save / f"{measurement}-isolines.geojson"
    with output.client() as client:
        client.save_isolines(measurement, path, levels=numbers, area=cast("Area", area))
    output.answer({"isolines": str(path)}, str(path))


def _read_levels(text: str) -> list[float]:
    try:
        return [float(level) for level in text.replace(",", " ").split()]
    except ValueError as error:
        raise typer.BadParameter('--levels needs numbers: "0.5,1,2"') from error

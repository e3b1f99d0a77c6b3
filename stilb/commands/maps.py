"""Readings of a measurement's map: along a line, of an area, and lines of equal value."""

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from stilb.commands.output import Output, command
from stilb.commands.tables import figure
from stilb.records import Quantity
from stilb.resources.maps import Area


@command
def read_map(
    output: Output,
    measurement: Annotated[str, typer.Argument(help="Id of a measurement that was made with a map.")],
    line: Annotated[str | None, typer.Option(help='Profile along corners "x,y x,y ..." in pixels.')] = None,
    across: Annotated[int, typer.Option(help="Pixels across the line that are averaged.")] = 1,
    levels: Annotated[
        str | None, typer.Option(help='Levels of isolines: "0.5,1,2"; default: round ones.')
    ] = None,
    area: Annotated[
        str | None,
        typer.Option(help="region, grid or frame; default: region, of isolines frame."),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Save profile and histogram as CSV, isolines as GeoJSON."),
    ] = None,
) -> None:
    """Read a map: profile, histogram, isolines.

    Shows the histogram's percentiles, and with --line the profile's figures.
    """
    if area not in {None, "region", "grid", "frame"}:
        raise typer.BadParameter("--area is region, grid or frame")
    chosen = cast("Area", area or "region")
    corners = None if line is None else _read_line(line)
    numbers = None if levels is None else _read_levels(levels)
    with output.client() as client:
        counted = client.histogram(measurement, area=chosen)
        found: dict[str, Any] = {"histogram": counted}
        if corners:
            found["profile"] = client.profile(measurement, corners, across_px=across)
        if save is not None:
            save.mkdir(parents=True, exist_ok=True)
            paths = [client.save_histogram(measurement, save / f"{measurement}-histogram.csv", area=chosen)]
            if corners:
                path = save / f"{measurement}-profile.csv"
                paths.append(client.save_profile(measurement, path, corners, across_px=across, most=10_000))
            path = save / f"{measurement}-isolines.geojson"
            lined = cast("Area", area or "frame")
            paths.append(client.save_isolines(measurement, path, levels=numbers, area=lined))
            for path in paths:
                output.note(str(path))
    output.answer(found, *_format(found))


def _format(found: dict[str, Any]) -> list[str]:
    counted = found["histogram"]
    ranks = {"too_dark": "too dark", "unknown": "saturated"}
    told = [
        f"{each['value']:.3g}" if "value" in each else ranks[each["rank"]] for each in counted["percentiles"]
    ]
    percents = [each["percent"] for each in counted["percentiles"]]
    listed = ", ".join(f"{percent} % {value}" for percent, value in zip(percents, told, strict=True))
    kinds = f"{counted['unknown']} saturated, {counted['too_dark']} too dark"
    shown = [
        f"{counted['area']}: {counted['pixels']} pixels, {kinds}",
        f"percentiles [{counted['unit']}]: {listed}",
    ]
    if "profile" in found:
        line = found["profile"]
        length = f"{line['length_px']:.0f} px" + (f", {line['length_m']:.2f} m" if "length_m" in line else "")
        gaps = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in line["gaps"].items() if count)
        shown.append(f"line of {length}: {len(line['points'])} points" + (f", {gaps}" if gaps else ""))
        named = [name for name in ("mean", "min", "max") if name in line]
        figures = [f"{name} {figure(Quantity(**line[name]))}" for name in named]
        shown += [", ".join(figures)] if figures else []
    notes = [*counted["notes"], *found.get("profile", {}).get("notes", [])]
    return [*shown, *dict.fromkeys(notes)]


def _read_line(text: str) -> list[tuple[float, float]]:
    try:
        found = [tuple(map(float, pair.split(","))) for pair in text.split()]
        corners = [(x, y) for x, y in found]
    except ValueError as error:
        raise typer.BadParameter('--line needs corners: "x,y x,y ..."') from error
    if len(corners) < 2:
        raise typer.BadParameter('--line needs two corners or more: "x,y x,y ..."')
    return corners


def _read_levels(text: str) -> list[float]:
    try:
        return [float(level) for level in text.replace(",", " ").split()]
    except ValueError as error:
        raise typer.BadParameter('--levels needs numbers: "0.5,1,2"') from error

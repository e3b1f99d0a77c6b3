"""Readings of a measurement's map: lines of equal value."""

from pathlib import Path
from typing import Annotated, cast

import typer

from stilb.commands.output import Output, command
from stilb.resources.maps import Area


@command
def read_map(
    output: Output,
    measurement: Annotated[str, typer.Argument(help="Id of a measurement that was made with a map.")],
    levels: Annotated[
        str | None, typer.Option(help='Levels of isolines: "0.5,1,2"; default: round ones.')
    ] = None,
    area: Annotated[str, typer.Option(help="region, grid or frame.")] = "frame",
    save: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the file goes.")] = Path(),
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

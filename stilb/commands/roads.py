"""`stilb road`: plan a road, state its points, evaluate it."""

import json
from pathlib import Path
from typing import Any

import typer

from stilb.client import Client
from stilb.commands.output import Output, command
from stilb.commands.terminal import table
from stilb.problem import Unclear
from stilb.records import Road, RoadResult

_SAVED = (".pdf", ".csv", ".geojson", ".png")


@command
def road(
    output: Output,
    stated: str = typer.Argument(..., metavar="FILE.json|ROAD", help="What is stated of a road, or its id."),
    points: Path | None = typer.Option(None, metavar="FILE.csv", help="Control points with their readings."),
    plan: Path | None = typer.Option(
        None, metavar="FILE.pdf", help="Plan the points, save their card, and evaluate nothing."
    ),
    e_av: float = typer.Option(0.06, help="Of a plan: wanted expanded uncertainty of E_av, relative."),
    u_0: float = typer.Option(0.05, help="Of a plan: wanted expanded uncertainty of U_0, relative."),
    save: Path | None = typer.Option(
        None, metavar="FOLDER", help="Save report, points as CSV and GeoJSON, and map."
    ),
) -> None:
    """Plan a road's points, or evaluate its illuminance."""
    with output.client() as client:
        chosen = _find(client, stated)
        if points is not None:
            client.set_road_points(chosen.id, points.read_text(encoding="utf-8-sig"))
        if plan is not None:
            told = client.plan_road(chosen.id, e_av_u_rel=e_av, u_0_u_rel=u_0)
            output.note(str(client.save_plan(chosen.id, plan, e_av_u_rel=e_av, u_0_u_rel=u_0)))
            rows = [(each["name"], f"{each['x_m']:.1f} m", f"{each['y_m']:.1f} m") for each in told["points"]]
            output.answer({"road_id": chosen.id, **told}, table(("point", "along", "across"), rows))
            return
        result = client.evaluate_road(chosen.id)
        if save is not None:
            save.mkdir(parents=True, exist_ok=True)
            for suffix in _SAVED:
                path = save / f"{chosen.id}-{result.number}{suffix}"
                output.note(str(client.save_road(result, path)))
    output.answer(result.raw, _show(result), f"{result.verdict.replace('_', ' ')}  {chosen.id}")


def _find(client: Client, stated: str) -> Road:
    if not stated.endswith(".json"):
        return client.road(stated)
    try:
        return client.create_road(**json.loads(Path(stated).read_text(encoding="utf-8")))
    except (ValueError, TypeError) as error:
        raise Unclear(f"{stated} is no JSON object: {error}") from error


def _show(result: RoadResult) -> Any:  # noqa: ANN401  rich's
    judged = {each["figure"]: each["verdict"].replace("_", " ") for each in result.raw["criteria"]}
    rows = [
        (
            each["figure"],
            f"{each['value']:.4g} ± {each['expanded_uncertainty']:.2g}",
            each["unit"],
            judged.get(each["figure"], ""),
        )
        for each in result.raw["figures"]
    ]
    return table(("figure", "value ± U (95 %)", "unit", "verdict"), rows)

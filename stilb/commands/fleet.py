"""Fleet verdicts: one set of coefficients for several cameras, or one for each."""

from typing import Annotated, Any

import typer
from rich.table import Table

from stilb.commands.completion import complete_method
from stilb.commands.output import Output, command
from stilb.commands.tables import figure, holds_for, table
from stilb.records import Quantity


@command
def fleet(
    output: Output,
    method: Annotated[str, typer.Argument(metavar="METHOD", autocompletion=complete_method)],
    cameras: Annotated[list[str], typer.Argument(metavar="CAMERA...", help="Ids or serial numbers.")],
    tolerance: Annotated[
        float, typer.Option(help="Largest accepted deviation: 0.04 is 4 %; of geometry, in pixels.")
    ],
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

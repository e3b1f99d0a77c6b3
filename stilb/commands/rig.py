"""Orientation of the cameras of a rig."""

from pathlib import Path
from typing import Annotated, Any

import typer

from stilb.commands.output import Output, command
from stilb.commands.tables import figure, table
from stilb.records import Quantity

_NUMBERS = ("yaw", "pitch", "roll", "x", "y", "z")


@command
def rig(
    output: Output,
    name: Annotated[str, typer.Argument(metavar="RIG", help="Its name or id.")],
    camera: Annotated[
        list[str] | None,
        typer.Option(
            help="Register the rig with this camera, by id or serial number; repeated, the reference first."
        ),
    ] = None,
    tolerance_deg: Annotated[
        float | None, typer.Option(metavar="DEG", help="Largest accepted change of an angle over all sets.")
    ] = None,
    tolerance_m: Annotated[
        float | None, typer.Option(metavar="M", help="Largest accepted change of a place over all sets.")
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Save it; the name says as what: opencv.yaml, rig.json or certificate.pdf.",
        ),
    ] = None,
) -> None:
    """Show how the cameras of a rig are oriented.

    From board pictures that its cameras took together, and whether it is stable over several sets of them.
    With --camera the rig is registered first.
    """
    with output.client() as client:
        found = (
            client.create_rig(name, [client.find_camera(each).id for each in camera])
            if camera
            else client.find_rig(name)
        )
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
                pose["camera"],
                name,
                figure(Quantity(**pose[name])),
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

"""Image motion during the exposure of each frame."""

from typing import Annotated, Any

import typer

from stilb.commands.completion import complete_campaign
from stilb.commands.exits import Exit
from stilb.commands.output import Output, command
from stilb.commands.tables import table

_WORDS = {True: "within", False: "BEYOND", None: "unknown"}


@command
def motion(
    output: Output,
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN", help="Its id or project number.", autocompletion=complete_campaign
        ),
    ],
    focal_length: Annotated[float, typer.Option(metavar="MM", help="Focal length of the lens [mm].")],
    pixel_pitch: Annotated[
        float | None, typer.Option(metavar="UM", help="Pixel pitch [um]; default: the camera's.")
    ] = None,
    limit: Annotated[
        float | None, typer.Option(metavar="PX", help="Largest tolerable motion; default: 0.5 px.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="M/S", help="Speed over ground; with --height.")
    ] = None,
    height: Annotated[
        float | None, typer.Option(metavar="M", help="Height above ground; with --speed.")
    ] = None,
    role: Annotated[str | None, typer.Option(help="Only frames of this role, such as field.")] = None,
) -> None:
    """Show the image motion in each frame.

    From the attitudes that the files of a campaign record, and from the speed over ground where it is given.
    """
    with output.client() as client:
        found = client.motion(
            client.find_campaign(campaign).id,
            focal_length_mm=focal_length,
            pixel_pitch_um=pixel_pitch,
            limit_px=limit,
            ground_speed_m_s=speed,
            distance_m=height,
            role=role,
        )
    counted = f"{found['within_limit']} within {found['limit_px']:g} px, {found['beyond_limit']} beyond"
    sentence = f"{found['frames']} frames, {found['with_rates']} with rates: {counted}"
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
                *(
                    f"{row[name]:.3g}" if name in row else ""
                    for name in (
                        "rotation_rate_deg_s",
                        "rotation_blur_px",
                        "forward_blur_px",
                        "theoretical_blur_px",
                    )
                ),
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

"""Coefficients in force for a camera."""

from typing import Annotated

import typer

from stilb.commands.completion import complete_camera, complete_method
from stilb.commands.moments import read_moment
from stilb.commands.output import Output, command
from stilb.commands.tables import of_coefficients
from stilb.field.template import read_methods
from stilb.method import DEFAULT_METHOD


@command
def k(
    output: Output,
    camera: Annotated[
        str, typer.Argument(metavar="CAMERA", help="Its id or serial number.", autocompletion=complete_camera)
    ],
    method: Annotated[
        str, typer.Option(help="Method of the coefficients.", autocompletion=complete_method)
    ] = DEFAULT_METHOD,
    iso: Annotated[float | None, typer.Option(help="Only this ISO value.")] = None,
    f_number: Annotated[float | None, typer.Option(help="At this f-number; default: in general.")] = None,
    at: Annotated[str | None, typer.Option(help="In force at this time; default: now.")] = None,
    known_at: Annotated[str | None, typer.Option(help="As known at this time; default: now.")] = None,
) -> None:
    """Show the K in force of a camera, with its uncertainty.

    And where it comes from. Of another method: every coefficient that is in force.
    """
    with output.client() as client:
        found = client.coefficients(
            client.find_camera(camera).id,
            method=method,
            name=read_methods()[method]["coefficients"][0]["name"] if method == DEFAULT_METHOD else None,
            iso=iso,
            f_number=f_number,
            at=read_moment(at),
            known_at=read_moment(known_at),
        )
    why = dict.fromkeys(row.why for row in found if row.why)
    output.answer({"items": [row.raw for row in found]}, of_coefficients(found), *why)

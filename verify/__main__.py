"""``stilb-verify`` and ``make verify``: recompute every quantity of a certificate or measurement.

The exit code is 0 when all agree to the last bit or to rounding, 1 when something differs, 2 when nothing can
be compared.
"""

import argparse
import os
import platform
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np
import scipy
from rich.console import Console
from rich.table import Table

try:
    import stilb
except ModuleNotFoundError:
    raise SystemExit(
        "stilb-verify: reads exports with the client: install the wheel of `stilb` too"
    ) from None
from radiometry.findings import shared
from radiometry.methods import get_method
from verify import checks, compare, data, measurement, recompute
from worker.decode.pool import DecoderKilled, DecoderPool, DecoderUnavailable

_HELD_FOR = {"iso": "ISO {:g}", "f_number": "f/{:g}", "band": "{}", "channel": "{}"}
_MOST_IN_GROUP = 12
_OF_MEASUREMENT = tuple(
    f"{name}.{part}" for name in ("mean", "value") for part in ("value", "standard_uncertainty")
)
_WORDS: Final[dict[compare.Agreement, str]] = {
    "same": "the same",
    "rounding": "to rounding",
    "different": "different",
}


def main(arguments: list[str] | None = None) -> int:
    """Verify, print the table, give the exit code."""
    asked = _read_arguments(arguments)
    console = Console(highlight=False)
    try:
        return _verify(asked.certificate, asked.data, asked.key, console)
    except (data.Unusable, stilb.Problem, DecoderKilled, DecoderUnavailable) as error:
        console.print(f"verify: {error}", markup=False, soft_wrap=True)
        return 2
    except (KeyError, TypeError, ValueError) as error:
        # a hand that edits a certificate may also take something away
        console.print(f"verify: the certificate or the data lack something: {error!r}", markup=False)
        return 2


def _verify(place: str, data_place: str, key: str, console: Console) -> int:
    certificate = data.read_certificate(place, key)
    if data.is_measurement(certificate):
        opened = data.open_export(data_place, key, certificate["id"], measured=True)
        with opened as folder, DecoderPool() as decoders:
            return _report(
                certificate, measurement.verify_measurement(certificate, folder, decoders), console
            )
    with DecoderPool() as decoders, console.status("reading the frames") as status:

        def tell(done: int, total: int) -> None:
            status.update(f"reading the frames: {done} of {total}")

        with data.open_export(data_place, key, certificate["calibration_id"]) as folder:
            held = data.read_folder(folder)
            rows = checks.check(certificate, held, recompute.recompute(certificate, held, decoders, tell))
    return _report(certificate, rows, console, standing=_state_standing(held.status))


def _read_arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="stilb-verify",
        description="Recompute a certificate, or a measurement, from what `stilb export` has downloaded.",
        epilog="Example:\n  stilb-verify calibration/certificate.json --data calibration",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("certificate", help="certificate.json or record.json, or an address on a server")
    parser.add_argument("--data", default="", help="an export's folder, or a server's address")
    parser.add_argument("--key", default=os.environ.get("STILB_KEY", ""), help="for a server; or STILB_KEY")
    asked = parser.parse_args(arguments)
    if not asked.data:
        if not data.is_address(asked.certificate):
            parser.error("say where the frames are: --data FOLDER or --data http://...")
        asked.data, _ = data.split_address(asked.certificate)
    return asked


def _report(certificate: data.Node, rows: list[compare.Row], console: Console, *, standing: str = "") -> int:
    console.print(_tabulate(certificate, rows))
    libraries = f"numpy {np.__version__} and scipy {scipy.__version__} on {platform.machine()}"
    more = f"{_name_unseen(certificate)}{_name_other_code(rows)}{standing}"
    answer = f"{_conclude(rows)}{more} Recomputed with {libraries}."
    console.print(answer, markup=False)
    return 1 if any(row.agreement == "different" for row in rows) else 0


def _tabulate(certificate: data.Node, rows: list[compare.Row]) -> Table:
    table = Table(title=_name(certificate), title_justify="left")
    for name in ("quantity", "certificate", "recomputed", "same?"):
        table.add_column(name, overflow="fold")
    for name, row in _list_headlines(certificate, rows):
        table.add_row(name, _show(row.certificate), _show(row.recomputed), _verdict(row))
    table.add_section()
    for group in dict.fromkeys(row.group for row in rows):
        mine = [row for row in rows if row.group == group]
        counts = Counter(row.agreement for row in mine)
        found = ", ".join(f"{counts[each]} {word}" for each, word in _WORDS.items() if counts[each])
        verdict = "NO" if counts["different"] else "rounding" if counts["rounding"] else "yes"
        table.add_row(f"{group.replace('_', ' ')} (all)", f"{len(mine)}", found, verdict)
    if different := [row for row in rows if row.agreement == "different"]:
        table.add_section()
    for group in dict.fromkeys(row.group for row in different):
        mine = [row for row in different if row.group == group]
        for row in mine[:_MOST_IN_GROUP]:
            name = f"{group}: {row.quantity}"
            table.add_row(name, _show(row.certificate), _show(row.recomputed), _verdict(row))
        if len(mine) > _MOST_IN_GROUP:
            table.add_row(f"{group}: and {len(mine) - _MOST_IN_GROUP} more", "", "", "NO")
    return table


def _list_headlines(certificate: data.Node, rows: list[compare.Row]) -> Iterator[tuple[str, compare.Row]]:
    """The results by name: every coefficient with u."""
    # the whole certificate is compared with the data's copy too, under the same names
    figures = {row.quantity: row for row in rows if row.group in ("iso_fits", "coefficients")}
    if data.is_measurement(certificate):
        means = {row.quantity: row for row in rows if row.group == "result"}
        yield from ((name, means[name]) for name in _OF_MEASUREMENT if name in means)
        return
    for index, coefficient in enumerate(certificate["coefficients"]):
        held = [form.format(coefficient[name]) for name, form in _HELD_FOR.items() if name in coefficient]
        label = get_method(certificate["method"]).label_coefficient(coefficient["name"])
        named = ", ".join([label, *held])
        for name, symbol in (("value", named), ("standard_uncertainty", f"u({named})")):
            if (row := figures.get(f"coefficients[{index}].{name}")) is not None:
                yield symbol, row


def _name(certificate: data.Node) -> str:
    named = f"Measurement {certificate['id']}" if data.is_measurement(certificate) else ""
    return named or f"Certificate {certificate['number']}"


def _name_unseen(certificate: data.Node) -> str:
    """Return how many frames were rows of a table, whose pixels nobody can recompute; "" if none was."""
    frames = certificate.get("frames", [])
    rows = sum(shared.STATISTICS_FROM_TABLE.sentence in frame.get("warnings", []) for frame in frames)
    said = f" Of {len(frames)} frames {rows} are rows of a table: their pixels were not seen."
    return said if rows else ""


def _name_other_code(rows: list[compare.Row]) -> str:
    """Return what explains most differences: a version that other code has fitted; "" if none has."""
    other = [row for row in rows if row.group == "software" and row.quantity == "stilb" and not row.same]
    said = " It was fitted with fit code version {}, this is {}: a release with the former recomputes it."
    return said.format(other[0].certificate, other[0].recomputed) if other else ""


def _state_standing(status: data.Node) -> str:
    """Return what a reader must know who holds the certificate of a version that was withdrawn."""
    if (state := status.get("state")) not in {"revoked", "superseded"}:
        return ""
    reason = f" ({status['revoked_reason']})" if "revoked_reason" in status else ""
    return f" The version was {state} when it was exported{reason}."


def _conclude(rows: list[compare.Row]) -> str:
    """Return the answer: the same to the last bit, the same to rounding, or different."""
    counts = Counter(row.agreement for row in rows)
    if counts["different"]:
        return f"{counts['different']} of {len(rows)} quantities differ."
    if not counts["rounding"]:
        return f"All {len(rows)} quantities are the same to the last bit."
    largest = max(row.relative for row in rows if row.agreement == "rounding")
    return (
        f"All {len(rows)} quantities are the same to rounding: {counts['same']} to the last bit, "
        f"{counts['rounding']} to {largest:.0e} of their uncertainty or size. Another processor or numeric "
        "library rounds differently."
    )


def _verdict(row: compare.Row) -> str:
    word = {"same": "yes", "rounding": "rounding", "different": "NO"}[row.agreement]
    return f"{word} {row.difference}".strip()


def _show(value: object) -> str:
    return value if isinstance(value, str) else repr(value)


if __name__ == "__main__":
    sys.exit(main())

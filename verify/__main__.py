"""``stilb-verify`` and ``make verify``: recompute every quantity of a certificate or measurement.

The exit code is 0 when all agree to the last bit or to rounding, 1 when something differs, 2 when nothing can
be compared.
"""

import argparse
import os
import sys

from rich.console import Console

import stilb
from verify import checks, compare, recompute
from verify.data import (
    Node,
    Unusable,
    is_address,
    is_measurement,
    open_export,
    read_certificate,
    read_folder,
    split_address,
)
from verify.measurement import verify_measurement
from verify.report import conclude, name_libraries, name_unseen, tabulate
from worker.decode.pool import DecoderKilled, DecoderPool, DecoderUnavailable


def main(arguments: list[str] | None = None) -> int:
    """Verify, print the table, give the exit code."""
    asked = _read_arguments(arguments)
    console = Console(highlight=False)
    try:
        return _verify(asked.certificate, asked.data, asked.key, console)
    except (Unusable, stilb.Problem, DecoderKilled, DecoderUnavailable) as error:
        console.print(f"verify: {error}", markup=False, soft_wrap=True)
        return 2
    except (KeyError, TypeError, ValueError) as error:
        # a hand that edits a certificate may also take something away
        console.print(f"verify: the certificate or the data lack something: {error!r}", markup=False)
        return 2


def _verify(place: str, data_place: str, key: str, console: Console) -> int:
    certificate = read_certificate(place, key)
    if is_measurement(certificate):
        opened = open_export(data_place, key, certificate["id"], measured=True)
        with opened as folder, DecoderPool() as decoders:
            return _report(certificate, verify_measurement(certificate, folder, decoders), console)
    with DecoderPool() as decoders, console.status("reading the frames") as status:

        def tell(done: int, total: int) -> None:
            status.update(f"reading the frames: {done} of {total}")

        with open_export(data_place, key, certificate["calibration_id"]) as folder:
            data = read_folder(folder)
            rows = checks.check(certificate, data, recompute.recompute(certificate, data, decoders, tell))
    return _report(certificate, rows, console)


def _report(certificate: Node, rows: list[compare.Row], console: Console) -> int:
    console.print(tabulate(certificate, rows))
    console.print(f"{conclude(rows)}{name_unseen(certificate)} {name_libraries()}", markup=False)
    return 1 if any(row.agreement == "different" for row in rows) else 0


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
        if not is_address(asked.certificate):
            parser.error("say where the frames are: --data FOLDER or --data http://...")
        asked.data, _ = split_address(asked.certificate)
    return asked


if __name__ == "__main__":
    sys.exit(main())

"""``python -m stilb export CALIBRATION FOLDER --url URL --key KEY``: all that a calibration rests on."""

import argparse
import os
import sys

import stilb


def main(arguments: list[str] | None = None) -> int:
    asked = _read_arguments(arguments)

    def tell(progress: stilb.ExportProgress) -> None:
        print(f"{progress.files_done}/{progress.files_total} {progress.filename}", file=sys.stderr)  # noqa: T201

    try:
        with stilb.Client(asked.url, asked.key) as client:
            folder = client.export(asked.calibration_id, asked.folder, on_progress=tell)
    except (stilb.Problem, OSError) as error:
        print(f"stilb: {error}", file=sys.stderr)  # noqa: T201
        return 1
    print(folder)  # noqa: T201
    return 0


def _read_arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m stilb")
    commands = parser.add_subparsers(required=True)
    export = commands.add_parser("export", help="fetch everything that a calibration rests on")
    export.add_argument("calibration_id")
    export.add_argument("folder")
    export.add_argument("--url", required=True, help="of the service")
    export.add_argument("--key", default=os.environ.get("STILB_KEY", ""), help="or STILB_KEY")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())

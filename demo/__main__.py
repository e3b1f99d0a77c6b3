"""`make demo`: start the service, simulate a campaign, calibrate through HTTP, compare with the truth.

The exit code is 0 only when every K agrees with the truth within three standard uncertainties. ``KEEP=1``
keeps serving until Ctrl-C. ``STILB_DATA`` names the data folder; without it a new one is made, and removed
at the end when nothing went wrong and nothing is kept.
"""

import os
import shutil
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from rich.console import Console

import stilb
from demo.campaign import TOLERANCE_REL, plan_campaign
from demo.child import NotServing, Service, serving
from demo.display import Display
from demo.frames import write_frames
from demo.journey import travel
from demo.report import as_table, compare

_SEED = 20250301


def main() -> int:
    """Run the demo and give its exit code."""
    # By default Python would end at once and leave everything behind; so it ends as by Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    console = Console()
    given = os.environ.get("STILB_DATA")
    keep = os.environ.get("KEEP", "") not in {"", "0"}
    data = Path(given).absolute() if given else _new_folder()
    try:
        code = _run(data, Display(console), keep=keep)
    except (stilb.Problem, NotServing) as error:
        console.print(f"demo: {error}", markup=False, highlight=False, soft_wrap=True)
        code = 1
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    if code == 1 or keep:
        console.print(f"demo: everything is in {data}, its logs too", highlight=False, soft_wrap=True)
    elif not given:
        shutil.rmtree(data, ignore_errors=True)
    return code


def _run(data: Path, display: Display, *, keep: bool) -> int:
    began = time.monotonic()
    campaign = plan_campaign(_SEED)
    with serving(data) as service:
        with display.stage(f"simulating {len(campaign.shots)} frames") as advance:
            paths = write_frames(campaign, data / "demo", on_written=advance)
        with stilb.Client(service.url, service.key) as client:
            outcome = travel(client, campaign, paths, display)
        rows = compare(outcome, truth=campaign.true_luminance_k, tolerance_rel=TOLERANCE_REL)
        display.show(as_table(rows))
        display.say(f"version {outcome.calibration.version} is {outcome.calibration.state}")
        display.say(f"every route: {service.url}/docs")
        display.say(f"in {time.monotonic() - began:.1f} s")
        if keep:
            _keep_serving(service, display)
    return 0 if all(row.agrees for row in rows) else 1


def _keep_serving(service: Service, display: Display) -> None:
    display.say(f"serving {service.url} key {service.key} until Ctrl-C")
    with suppress(KeyboardInterrupt):
        service.wait_for_end()


def _new_folder() -> Path:
    parent = Path("stilb-data").absolute()
    parent.mkdir(exist_ok=True)
    return Path(tempfile.mkdtemp(prefix=time.strftime("demo-%Y%m%d-%H%M%S-"), dir=parent))


if __name__ == "__main__":
    sys.exit(main())

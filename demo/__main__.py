"""`make demo METHOD=...`: start the service, simulate, calibrate through HTTP, compare with the truth.

The exit code is 0 only when every figure agrees with the truth within three standard uncertainties. Without
``METHOD`` it is luminance. ``CAMERA`` chooses among the cameras of a method's demo. ``KEEP=1`` keeps serving
until Ctrl-C. ``STILB_DATA`` names the data folder; without it a new one is made, and removed at the end when
nothing went wrong and nothing is kept.
"""

import importlib
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
from demo import child, journey
from radiometry.methods import METHODS


def main() -> int:
    """Run the demo and return its exit code."""
    # By default Python would end at once and leave everything behind; so it ends as by Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    console = Console()
    asked = os.environ.get("METHOD") or "luminance"
    names = [*(spec.name for spec in METHODS), "road"]
    if asked not in names:
        console.print(f"demo: METHOD is one of {', '.join(names)}", highlight=False, soft_wrap=True)
        return 2
    camera = os.environ.get("CAMERA", "")
    known = getattr(importlib.import_module(f"demo.{asked}"), "CAMERAS", ())
    if camera and camera not in known:
        cameras = f"is one of {', '.join(known)}" if known else "cannot be chosen"
        console.print(f"demo: CAMERA {cameras} with METHOD={asked}", highlight=False, soft_wrap=True)
        return 2
    given = os.environ.get("STILB_DATA")
    keep = os.environ.get("KEEP", "") not in {"", "0"}
    parent = Path("stilb-data").absolute()
    parent_is_new = not given and not parent.exists()
    if not given:
        parent.mkdir(mode=0o700, exist_ok=True)
    prefix = time.strftime("demo-%Y%m%d-%H%M%S-")
    data = Path(given).absolute() if given else Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        code = _run(asked, camera, data, journey.Display(console), keep=keep)
    except (stilb.Problem, child.NotServing) as error:
        console.print(f"demo: {error}", markup=False, highlight=False, soft_wrap=True)
        code = 1
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    if code == 1 or keep:
        console.print(f"demo: everything is in {data}, its logs too", highlight=False, soft_wrap=True)
    elif not given:
        shutil.rmtree(data, ignore_errors=True)
        if parent_is_new:
            with suppress(OSError):  # other data may lie there by now
                parent.rmdir()
    return code


def _run(method: str, camera: str, data: Path, display: journey.Display, *, keep: bool) -> int:
    began = time.monotonic()
    with child.serving(data) as service:
        with stilb.Client(service.url, service.key) as client:
            folder = data / "demo" / method / camera
            agrees = play(method, journey.Stage(client=client, folder=folder, display=display, camera=camera))
            for each in client.cameras():
                for version in client.history(each.id, method=method, state="published"):
                    display.say(f"in a browser: {service.url}/calibrations/{version.id}")
        display.say(f"every route: {service.url}/docs")
        display.say(f"in {time.monotonic() - began:.1f} s")
        if keep:
            display.say(f"serving {service.url} key {service.key} until Ctrl-C")
            with suppress(KeyboardInterrupt):
                service.process.wait()
    return 0 if agrees else 1


def play(method: str, stage: journey.Stage) -> bool:
    """Run the demo of a method, in the module of its name; return True if all agrees with the truth."""
    return bool(importlib.import_module(f"demo.{method}").run(stage))


if __name__ == "__main__":
    sys.exit(main())

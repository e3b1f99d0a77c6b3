"""The procedure's own way: a TIFF made of the raw file, and an ImageJ macro over it. Only where installed."""

import os
import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from bench.report import say
from bench.timing import Seconds
from radiometry.frame.roi import Polygon

_REPEATS = 3
_IN_ONE_RUN = 4  # frames; ImageJ's start is shared by all of a folder
_JARS = ("/usr/share/java/ij.jar", "/usr/share/imagej/ij.jar")


def run(path: Path, polygon: Polygon, *, ours: Seconds) -> None:
    """Time `dcraw -D -4 -T` on one frame, and ImageJ's own count of the region in a run over four."""
    dcraw, command = shutil.which("dcraw"), find_imagej()
    if dcraw is None or command is None:
        say("  dcraw and an ImageJ macro: not installed, skipped")
        return
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        folder = Path(name)
        seconds = min(_convert_and_count(dcraw, command, path, polygon, folder) for _ in range(_REPEATS))
    times = seconds / sorted(ours)[len(ours) // 2]
    say(f"  {'dcraw -D -4 -T and an ImageJ macro (its start shared)':<54} {1e3 * seconds:8.1f} ms")
    say(f"  {'times faster than dcraw and ImageJ, best of theirs':<54} {times:.0f}")


def find_imagej() -> list[str] | None:
    """The command that runs a macro without a window; `IJ_JAR` names a jar of one's own."""
    java = shutil.which("java")
    jar = next((jar for jar in (os.environ.get("IJ_JAR", ""), *_JARS) if jar and Path(jar).is_file()), None)
    # Headless, Java forbids the menus that ImageJ makes before it opens a file; they are never shown.
    return [java, "-Djava.awt.headless=false", "-jar", jar, "-batch"] if java and jar else None


def _convert_and_count(dcraw: str, command: list[str], path: Path, polygon: Polygon, folder: Path) -> float:
    """Seconds a frame."""
    tiff, macro = folder / "frame.tiff", folder / "count.ijm"
    began = time.perf_counter()
    with tiff.open("wb") as file:
        subprocess.run([dcraw, "-D", "-4", "-T", "-c", str(path)], check=True, stdout=file)
    converted = time.perf_counter() - began
    corners = ",".join(f"{x:g},{y:g}" for x, y in polygon.points)
    macro.write_text(
        f'setBatchMode(true); for (i = 0; i < {_IN_ONE_RUN}; i++) {{ open("{tiff}"); makePolygon({corners}); '
        'getStatistics(area, mean, min, max, std); print("n", area, mean, min, max, std); close(); }\n'
    )
    began = time.perf_counter()
    done = subprocess.run([*command, str(macro)], check=True, capture_output=True, text=True)
    counted = time.perf_counter() - began
    if len(re.findall(r"^n \d+", done.stdout, re.MULTILINE)) != _IN_ONE_RUN:
        raise AssertionError(f"ImageJ did not count: {done.stdout[-500:]} {done.stderr[:500]}")
    return converted + counted / _IN_ONE_RUN

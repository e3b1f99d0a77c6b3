"""Imports at the start of a process, which cost time and memory in each."""

import subprocess
import sys

LARGE = {
    *(
        "scipy.special",
        "scipy.linalg",
        "scipy.optimize",
        "scipy.ndimage",
        "scipy.signal",
        "scipy.stats",
        "cv2",
    ),
    *("celery", "kombu", "redis", "psycopg", "obstore", "alembic", "typst", "rawpy", "imagecodecs"),
}


def test_processes_start_without_large_libraries():
    program = (
        "import sys, service.__main__, worker.__main__, worker.sweeper, store.migrate\n"
        f"sys.exit(' '.join({LARGE} & sys.modules.keys()) or None)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")

"""What every process of the service pays for when it starts."""

import subprocess
import sys


def test_no_method_brings_scipy_stats_along():
    """It takes half a second, also by way of scipy.signal; what needs it imports it where it computes."""
    said = "import radiometry.methods, sys; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", said], check=False).returncode == 0

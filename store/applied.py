"""Values of a version for later frames, as its method takes them."""

from typing import Any

from radiometry.methods import get_method
from store.codec import decode
from store.tables import Calibration


def read_applied(calibration: Calibration) -> Any:  # noqa: ANN401  the method's own
    """Return what a version applies to other frames: its coefficients, or its one model."""
    spec = get_method(calibration.method)
    stored = calibration.result[spec.applied]
    plain = [fit["coefficient"] for fit in stored] if isinstance(stored, list) else stored
    return decode(spec.applied_type, plain)

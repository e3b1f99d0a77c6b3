"""The client: one method a thing that a field team or a dashboard does."""

from stilb.resources.calibrations import Calibrations, Coefficients
from stilb.resources.campaigns import Campaigns
from stilb.resources.equipment import Rigs
from stilb.resources.frames import Frames, Receipts
from stilb.resources.measurements import Maps, Measurements
from stilb.resources.organisation import Organisation, System


class Client(
    Rigs,
    Coefficients,
    Calibrations,
    Campaigns,
    Frames,
    Maps,
    Measurements,
    Organisation,
    Receipts,
    System,
):
    """A connection to one calibration service, for one key. Use it as a context manager.

    ``timeout`` is how long one silence of the service may last [s]. What is safe to send twice is sent again
    after a lost connection or a passing refusal, up to ``retries`` times, first after about ``backoff_s``,
    then after twice as long each time: by default for a minute and a half at least, which outlasts a restart
    of the service on a slow machine. ``on_retry`` is told each time, from whichever thread sends.
    """

"""The client: one method a thing that a field team or a dashboard does."""

from stilb.resources import calibrations, campaigns, equipment, frames, measurements, organisation, roads


class Client(
    equipment.Rigs,
    calibrations.Coefficients,
    calibrations.Calibrations,
    campaigns.Campaigns,
    frames.Frames,
    measurements.Maps,
    measurements.Measurements,
    organisation.Organisation,
    roads.Roads,
    frames.Receipts,
    organisation.System,
):
    """A connection to one calibration service, for one key. Use it as a context manager.

    ``timeout`` is how long one silence of the service may last [s]. What is safe to send twice is sent again
    after a lost connection or a passing refusal, up to ``retries`` times, first after about ``backoff_s``,
    then after twice as long each time: by default for a minute and a half at least, which outlasts a restart
    of the service on a slow machine. ``on_retry`` is told each time, from whichever thread sends.
    """

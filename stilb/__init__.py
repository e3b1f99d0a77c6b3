"""The client of the calibration service: ``stilb.Client``. Speaks HTTP and knows nobody.

with stilb.Client("http://127.0.0.1:8000", key) as client:
    frame = client.push(campaign_id, "DJI_0001.DNG", role="light", scene="level-1")
    client.wait(frame.job_id)
    calibration = client.calibrate(campaign_id)
"""

from stilb.client import Client
from stilb.export import ExportProgress
from stilb.problem import JobFailed, Problem
from stilb.records import (
    Calibration,
    Camera,
    Campaign,
    Coefficient,
    Frame,
    Job,
    Meter,
    Polygon,
    Reading,
)
from stilb.upload import Progress, Upload

__all__ = [
    "Calibration",
    "Camera",
    "Campaign",
    "Client",
    "Coefficient",
    "ExportProgress",
    "Frame",
    "Job",
    "JobFailed",
    "Meter",
    "Polygon",
    "Problem",
    "Progress",
    "Reading",
    "Upload",
]

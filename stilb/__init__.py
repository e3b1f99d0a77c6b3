"""The client of the calibration service: ``stilb.Client``. Speaks HTTP and imports no other room.

with stilb.Client("http://127.0.0.1:8000", key) as client:
    frame = client.push(campaign_id, "DJI_0001.DNG", role="light", scene="level-1")
    client.wait(frame.job_id)
    calibration = client.calibrate(campaign_id)
"""

from stilb.client import Client
from stilb.export import ExportProgress
from stilb.problem import JobFailed, Problem, Unclear
from stilb.records import (
    AuditChain,
    AuditEntry,
    Calibration,
    Camera,
    Campaign,
    Coefficient,
    Comparison,
    Frame,
    Grid,
    Job,
    Key,
    KnownFrame,
    Measurement,
    Meter,
    OwnKey,
    Panel,
    PanelBand,
    Polygon,
    Quantity,
    Reading,
    Reason,
    Rig,
    Road,
    RoadResult,
)
from stilb.resources.organisation import Health
from stilb.upload import Progress, Upload

__all__ = ["AuditChain", "AuditEntry", "Calibration", "Camera", "Campaign", "Client", "Coefficient"]
__all__ += ["Comparison", "ExportProgress", "Frame", "Grid", "Health", "Job", "JobFailed", "Key"]
__all__ += ["KnownFrame", "Measurement", "Meter", "OwnKey", "Panel", "PanelBand", "Polygon", "Problem"]
__all__ += ["Progress", "Quantity", "Reading", "Reason", "Rig", "Road", "RoadResult", "Unclear"]
__all__ += ["Upload"]

"""Every table, under its name."""

from store.tables.audit import AuditEntry
from store.tables.base import Audited, Base
from store.tables.calibration import Calibration, CoefficientRow, Publication, Revocation, Slot
from store.tables.campaign import Blob, Campaign, ChannelRow, Extraction, FrameRow, Reading, Roi
from store.tables.equipment import Camera, Meter
from store.tables.identity import ApiKey, IdempotentAnswer, Organisation
from store.tables.job import Job

__all__ = [
    "ApiKey",
    "AuditEntry",
    "Audited",
    "Base",
    "Blob",
    "Calibration",
    "Camera",
    "Campaign",
    "ChannelRow",
    "CoefficientRow",
    "Extraction",
    "FrameRow",
    "IdempotentAnswer",
    "Job",
    "Meter",
    "Organisation",
    "Publication",
    "Reading",
    "Revocation",
    "Roi",
    "Slot",
]

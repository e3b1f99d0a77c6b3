"""Every table, under its name."""

from store.tables.audit import AuditChain, AuditEntry, AuditHead
from store.tables.base import Audited, Base
from store.tables.calibration import (
    Calibration,
    CoefficientRow,
    IssuedCertificate,
    Publication,
    Revocation,
    Slot,
)
from store.tables.campaign import Blob, Campaign, ChannelRow, Extraction, FrameRow, Reading, Roi
from store.tables.crop import Crop
from store.tables.equipment import Camera, Meter, Panel, Rig
from store.tables.identity import ApiKey, IdempotentAnswer, Organisation, Usage, WebSession
from store.tables.job import Job, Turn
from store.tables.kept import CampaignReview, FrameChange, FrameVerdict, Rendering, SmallPreview
from store.tables.measurement import Measurement
from store.tables.part import PartRow
from store.tables.ready import MeasuredRow, ReadyAnswer, ReadyCells, ReadyRow
from store.tables.receipt import Manifest, SigningKey
from store.tables.review import ChecklistSignature, ChecklistTick, Recall
from store.tables.webhook import Webhook, WebhookDelivery

__all__ = [
    "ApiKey",
    "AuditChain",
    "AuditEntry",
    "AuditHead",
    "Audited",
    "Base",
    "Blob",
    "Calibration",
    "Camera",
    "Campaign",
    "CampaignReview",
    "ChannelRow",
    "ChecklistSignature",
    "ChecklistTick",
    "CoefficientRow",
    "Crop",
    "Extraction",
    "FrameChange",
    "FrameRow",
    "FrameVerdict",
    "IdempotentAnswer",
    "IssuedCertificate",
    "Job",
    "Manifest",
    "MeasuredRow",
    "Measurement",
    "Meter",
    "Organisation",
    "Panel",
    "PartRow",
    "Publication",
    "Reading",
    "ReadyAnswer",
    "ReadyCells",
    "ReadyRow",
    "Recall",
    "Rendering",
    "Revocation",
    "Rig",
    "Roi",
    "SigningKey",
    "Slot",
    "SmallPreview",
    "Turn",
    "Usage",
    "WebSession",
    "Webhook",
    "WebhookDelivery",
]

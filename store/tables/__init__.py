"""Every table, under its name."""

from store.tables.audit import AuditChain, AuditEntry, AuditHead
from store.tables.base import Audited, Base
from store.tables.calibration import (
    Calibration,
    CoefficientRow,
    IssuedCertificate,
    MeasuredRow,
    Measurement,
    Publication,
    ReadyAnswer,
    ReadyCells,
    ReadyRow,
    Revocation,
    Slot,
)
from store.tables.campaign import (
    Blob,
    Campaign,
    CampaignReview,
    ChannelRow,
    ChecklistSignature,
    ChecklistTick,
    Crop,
    Extraction,
    FrameChange,
    FrameRow,
    FrameVerdict,
    Manifest,
    Reading,
    Recall,
    Rendering,
    Roi,
    SigningKey,
    SmallPreview,
)
from store.tables.job import Job, PartRow, Turn
from store.tables.organisation import (
    ApiKey,
    Camera,
    IdempotentAnswer,
    Meter,
    Organisation,
    Panel,
    Rig,
    Usage,
    WebSession,
)

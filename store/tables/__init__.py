"""Every table under its name, and what all of them are made of."""

from store.tables.audit import AuditChain, AuditEntry, AuditHead
from store.tables.base import Audited, Base, Json, UtcDateTime, insert_or_not, new_id, utc_now
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
    Road,
    RoadResult,
    Slot,
)
from store.tables.campaign import (
    Blob,
    Campaign,
    CampaignKind,
    CampaignReview,
    ChannelRow,
    ChecklistSignature,
    ChecklistTick,
    Crop,
    Extraction,
    FrameChange,
    FrameRow,
    FrameState,
    FrameVerdict,
    Manifest,
    Reading,
    Recall,
    Rendering,
    Roi,
    SigningKey,
    SmallPreview,
)
from store.tables.job import Job, JobKind, JobState, PartRow, Turn
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

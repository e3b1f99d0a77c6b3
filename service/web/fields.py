"""Descriptions of the fields of forms, for the pages: the same that the OpenAPI document has."""

from typing import Final

from service.routes.organisation import OrganisationChange
from service.schemas.base import Form
from service.schemas.calibrations import NewPublication, NewRevocation
from service.schemas.campaigns import NewCampaign, NewReading, NewRoi
from service.schemas.checklist import ItemChange, NewSignature
from service.schemas.equipment import Certificate, Lens, NewCamera, NewMeter
from service.schemas.frames import FrameChange
from service.schemas.keys import NewKey
from service.schemas.measurements import MeasurementOptions, NewGrid
from service.schemas.panels import NewPanel
from service.schemas.rigs import NewRig

SHOWN: Final[tuple[type[Form], ...]] = (
    Certificate,
    FrameChange,
    ItemChange,
    Lens,
    MeasurementOptions,
    NewCamera,
    NewCampaign,
    NewGrid,
    NewKey,
    NewMeter,
    NewPanel,
    NewPublication,
    NewReading,
    NewRevocation,
    NewRig,
    NewRoi,
    NewSignature,
    OrganisationChange,
)
"""Forms that a page asks a person to fill in."""


def describe_fields() -> dict[str, dict[str, str]]:
    """Return the sentence of each field, by form and name."""
    return {
        form.__name__: {name: field.description or "" for name, field in form.model_fields.items()}
        for form in SHOWN
    }

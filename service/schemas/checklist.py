"""The checklist of a campaign."""

from typing import Annotated

from pydantic import ConfigDict, Field, Strict, model_validator

from service.schemas.base import Answer, Form, Instant, LongText, Text
from store.queries.checklist import ChecklistItem
from store.tables import ChecklistSignature


class ItemChange(Form):
    key: Text
    done: Annotated[bool, Strict()]
    note: LongText | None = None


class NewSignature(Form):
    name: Text = Field(description="The operator's name, as signed below the printed checklist.")


class ChecklistChange(Form):
    """Ticks to set or to take away, a signature, or both."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "items": [{"key": "equipment_lamp", "done": True, "note": "40 W halogen, 3.2 m away"}],
                    "signature": {"name": "A. Meier"},
                }
            ],
            "anyOf": [{"required": ["items"]}, {"required": ["signature"]}],
        }
    )

    items: Annotated[list[ItemChange] | None, Field(min_length=1, max_length=1000)] = None
    signature: NewSignature | None = None

    @model_validator(mode="after")
    def _changes_something(self) -> "ChecklistChange":
        if self.items is None and self.signature is None:
            raise ValueError("give items, a signature, or both")
        return self


class ItemAnswer(Answer):
    key: str
    section: str
    text: str
    done_by: str | None = Field(
        default=None, description='A key\'s id; "stilb" for what follows from the record. Absent while open.'
    )
    done_at: Instant | None = None
    evidence: str | None = Field(default=None, description="From what it follows.")
    missing: str | None = Field(default=None, description="What the record still lacks for it.")
    note: str | None = None


class SignatureAnswer(Answer):
    name: str
    signed_by: str
    signed_at: Instant


class ChecklistAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "campaign_id": "cmp_1",
                    "done": 1,
                    "open": 1,
                    "items": [
                        {
                            "key": "settings_format_dng",
                            "section": "Adjust Zenmuse X5S Camera Settings for Image Shooting",
                            "text": "The images should be taken in (.DNG) format",
                            "done_by": "stilb",
                            "done_at": "2026-05-01T09:00:00Z",
                            "evidence": "Every light and dark frame is a raw DNG: 2 frames "
                            "(DJI_0001.DNG, DJI_0002.DNG).",
                        },
                        {
                            "key": "equipment_lamp",
                            "section": "Drone Camera Calibration Equipment",
                            "text": "A dimmable lamp",
                        },
                    ],
                }
            ]
        }
    )

    campaign_id: str
    done: int
    open: int
    items: list[ItemAnswer]
    signature: SignatureAnswer | None = None
    said: str | None = Field(default=None, description="Why there are no items, where there are none.")

    @classmethod
    def of(
        cls, campaign_id: str, items: list[ChecklistItem], signature: ChecklistSignature | None
    ) -> "ChecklistAnswer":
        done = sum(item.done_by is not None for item in items)
        return cls(
            campaign_id=campaign_id,
            done=done,
            open=len(items) - done,
            items=[ItemAnswer.model_validate(item) for item in items],
            signature=SignatureAnswer.model_validate(signature) if signature else None,
        )


def explain_missing_checklist(method: str) -> str:
    """Why a campaign has no items."""
    return f"The printed checklist is that of the luminance procedure; a {method} campaign has none."

"""The checklist of a campaign."""

from typing import Annotated

from pydantic import ConfigDict, Field, Strict, model_validator

from service.schemas.base import Answer, Form, LongText, Text
from store.queries.checklist import ChecklistItem
from store.tables import Campaign, ChecklistSignature


class ItemChange(Form):
    key: Annotated[Text, Field(description="One of the items that the campaign's checklist lists.")]
    done: Annotated[bool, Strict()] = Field(description="false takes the tick away.")
    note: LongText | None = Field(
        default=None, description="What was done, and with which equipment; recorded with the item."
    )


class NewSignature(Form):
    name: Text = Field(description="The operator's name, as signed below the printed checklist.")


class ChecklistChange(Form):
    """Ticks to set or to take away, a signature, or both."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["items"]}, {"required": ["signature"]}]}
    )

    items: Annotated[list[ItemChange] | None, Field(min_length=1, max_length=1000)] = None
    signature: NewSignature | None = None

    @model_validator(mode="after")
    def _changes_something(self) -> "ChecklistChange":
        if self.items is None and self.signature is None:
            raise ValueError("give items, a signature, or both")
        return self


class ItemAnswer(Answer, restates=ChecklistItem):
    pass


class SignatureAnswer(Answer, restates=ChecklistSignature, fields="name signed_by signed_at state_sha256"):
    changed: bool = Field(
        description="Whether details, frames, readings, region or ticks are other than when it was signed."
    )


class ChecklistAnswer(Answer):
    campaign_id: str
    done: int
    open: int
    items: list[ItemAnswer]
    signature: SignatureAnswer | None = None
    said: str | None = Field(default=None, description="Why there are no items, where there are none.")

    @classmethod
    def of(
        cls, campaign_id: str, items: list[ChecklistItem], signature: ChecklistSignature | None, state: str
    ) -> "ChecklistAnswer":
        """Return the list; ``state`` is the hash of what a signature would sign now."""
        done = sum(item.done_by is not None for item in items)
        return cls.restate(
            campaign_id=campaign_id,
            done=done,
            open=len(items) - done,
            items=items,
            signature=SignatureAnswer.restate(signature, changed=signature.state_sha256 not in {None, state})
            if signature
            else None,
        )


def explain_missing_checklist(campaign: Campaign) -> str:
    """Why a campaign has no items."""
    kind = "night of measurements" if campaign.measures else f"{campaign.method} campaign"
    return f"The printed checklist is that of the luminance procedure; a {kind} has none."

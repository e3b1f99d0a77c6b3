"""Manifests of cards: what is missing, and the signed receipt when nothing is."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.schemas.base import WHOLE, Answer, Form, Instant, Sha256
from service.schemas.frames import State
from store.tables import Manifest, SigningKey

MOST_FILES = 20_000

FileName = Annotated[
    str, StringConstraints(min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")
]
Size = Annotated[int, Field(ge=0, lt=1 << 50, strict=True), WHOLE]


class OtherFile(Form):
    name: FileName
    size_bytes: Size


class ManifestFile(OtherFile):
    sha256: Sha256


class NewManifest(Form):
    files: Annotated[list[ManifestFile], Field(min_length=1, max_length=MOST_FILES)]
    others: Annotated[list[OtherFile], Field(max_length=MOST_FILES)] = Field(
        default=[], description="Files of the card that are not sent. The receipt names them as not covered."
    )


class MissingFile(Answer):
    name: str
    size_bytes: int
    sha256: str
    reason: Literal["not_received", "damaged", "size_differs"] = Field(
        description="`damaged`: the stored file is damaged or gone; the same upload heals it. "
        "`size_differs`: the file with this hash has another size, so that the manifest is wrong."
    )


class ManifestAnswer(Answer, restates=Manifest, fields="id campaign_id sha256 created_at"):
    """Completeness of a manifest as things stand now."""

    files: int
    stored: int = Field(description="How many of them are stored whole.")
    complete: bool
    missing: list[MissingFile] = Field(description="In the order of the manifest.")
    receipt: str | None = Field(default=None, description="Address of the receipt, once it is complete.")


class ReceivedFile(Answer):
    """A file of the card, and the frame of the campaign that holds its bytes."""

    name: str
    size_bytes: int
    sha256: str
    frame_id: str
    received_at: Instant
    hash_checked_at: Instant = Field(
        description="When the service last hashed all of the bytes and found this SHA-256: as they "
        "arrived, or as it read them back since."
    )
    state: State = Field(description="`refused`: stored, but not usable as a frame.")
    refusal_code: str | None = None
    withdrawn_at: Instant | None = Field(default=None, description="Stored, but withdrawn from the campaign.")
    same_as: str | None = Field(
        default=None,
        description="An earlier file of this manifest with the same bytes, which are stored once.",
    )


class ReceiptStatement(Answer):
    """Facts that the service attests."""

    type: Literal["stilb receipt 1"]
    statement: str
    issued_at: Instant
    key_id: str
    software: str
    organisation: str
    campaign_id: str
    project_number: str | None = None
    manifest_id: str
    manifest_sha256: str
    files_count: int
    size_bytes: int
    distinct_files_count: int
    distinct_size_bytes: int
    refused_count: int
    withdrawn_count: int
    files: list[ReceivedFile]
    not_covered: list[OtherFile]


class ReceiptSignature(Answer):
    algorithm: Literal["Ed25519"]
    key_id: str
    value: str = Field(description="In Base64, over `receipt` in canonical JSON (RFC 8785).")


class ReceiptAnswer(Answer):
    receipt: ReceiptStatement
    signature: ReceiptSignature


class SigningKeyAnswer(Answer, restates=SigningKey, fields="id public_key"):
    """A public key of the service, in PEM."""

    algorithm: Literal["Ed25519"] = "Ed25519"
    created_at: datetime


class SigningKeys(Answer):
    items: list[SigningKeyAnswer] = Field(description="Newest first. None is ever removed.")

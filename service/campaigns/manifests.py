"""Manifests of cards, and the signed receipts for which a card may be formatted."""

import hashlib
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import Query, Response
from pydantic import Field, StringConstraints
from sqlalchemy import Row, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.http import answers, auth, changes, lookup, models, operations, problems, signatures
from service.http.context import Context, UsesContext
from store.queries.campaigns import find_manifest, read_stored, write_canonical
from store.software import read_version
from store.tables import Campaign, FrameState, Manifest, SigningKey, utc_now

MOST_FILES = 20_000

FileName = Annotated[
    str, StringConstraints(min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")
]
Size = Annotated[int, Field(ge=0, lt=1 << 50, strict=True), models.WHOLE]


class OtherFile(models.Form):
    name: FileName
    size_bytes: Size


class ManifestFile(OtherFile):
    sha256: models.Sha256


class NewManifest(models.Form):
    files: Annotated[list[ManifestFile], Field(min_length=1, max_length=MOST_FILES)]
    others: Annotated[list[OtherFile], Field(max_length=MOST_FILES)] = models.told(
        "Files of the card that are not sent. The receipt names them as not covered.", default=[]
    )


class MissingFile(models.Answer):
    name: str
    size_bytes: int
    sha256: str
    reason: Literal["not_received", "damaged", "size_differs"] = models.told(
        "`damaged`: the stored file is damaged or gone; the same upload heals it. "
        "`size_differs`: the file with this hash has another size, so that the manifest is wrong."
    )


class ManifestAnswer(models.Answer, restates=Manifest, fields="id campaign_id sha256 created_at"):
    """Completeness of a manifest as things stand now."""

    files: int
    stored: int = models.told("How many of them are stored whole.")
    complete: bool
    missing: list[MissingFile] = models.told("In the order of the manifest.")
    receipt: str | None = models.maybe("Address of the receipt, once it is complete.")


class ReceivedFile(models.Answer):
    """A file of the card, and the frame of the campaign that holds its bytes."""

    name: str
    size_bytes: int
    sha256: str
    frame_id: str
    received_at: models.Instant
    hash_checked_at: models.Instant = models.told(
        "When the service last hashed all of the bytes and found this SHA-256: as they "
        "arrived, or as it read them back since."
    )
    state: FrameState = models.told("`refused`: stored, but not usable as a frame.")
    refusal_code: str | None = None
    withdrawn_at: models.Instant | None = models.maybe("Stored, but withdrawn from the campaign.")
    same_as: str | None = models.maybe(
        "An earlier file of this manifest with the same bytes, which are stored once."
    )


class ReceiptStatement(models.Answer):
    """Facts that the service attests."""

    type: Literal["stilb receipt 1"]
    statement: str
    issued_at: models.Instant
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


class ReceiptSignature(models.Answer):
    algorithm: Literal["Ed25519"]
    key_id: str
    value: str = models.told("In Base64, over `receipt` in canonical JSON (RFC 8785).")


class ReceiptAnswer(models.Answer):
    receipt: ReceiptStatement
    signature: ReceiptSignature


class SigningKeyAnswer(models.Answer, restates=SigningKey, fields="id public_key"):
    """A public key of the service, in PEM."""

    algorithm: Literal["Ed25519"] = "Ed25519"
    created_at: datetime


class SigningKeys(models.Answer):
    items: list[SigningKeyAnswer] = models.told("Newest first. None is ever removed.")


router = operations.Router(prefix="/v1", tags=["manifests"])
keys_router = operations.Router(prefix="/v1", tags=["manifests"])

_MOST_NAMED = 100
_STATEMENT = (
    "This service has stored every byte of the files listed here. It computed the SHA-256 of each itself, "
    "from the bytes that arrived or that it read back, and it equals the one that the sender stated. At "
    "issued_at each stored file was present with its whole size and not known to be damaged. The sender "
    "named the files under not_covered as not sent; a file in neither list is unknown to this receipt. "
    "Whether a frame is of use is not attested: state, refusal_code and withdrawn_at give what was known "
    "at issued_at."
)


@router.post("/campaigns/{campaign_id}/manifest", response_model=ManifestAnswer)
def send_manifest(
    campaign: lookup.Own[Campaign],
    body: NewManifest,
    caller: auth.Uploader,
    context: UsesContext,
    _idempotency_key: changes.IdempotencyKey = None,
) -> Response:
    """State what a card holds, and learn which of its files the campaign has not stored.

    The same manifest again is the same one, and answers as things stand then, whatever the `Idempotency-Key`.
    """
    said = body.model_dump(mode="json")
    sha256 = hashlib.sha256(write_canonical(said)).hexdigest()
    same = select(Manifest).where(Manifest.campaign_id == campaign.id, Manifest.sha256 == sha256)
    with context.database.reading() as session:
        manifest = session.scalar(same)
    if manifest is None:
        manifest = Manifest(
            organisation_id=caller.organisation_id, campaign_id=campaign.id, sha256=sha256, **said
        )
        try:
            with context.database.writing(caller.key_id, caller.organisation_id) as session:
                session.add(manifest)
        except IntegrityError:  # sent twice at once
            with context.database.reading() as session:
                manifest = session.scalars(same).one()
    missing, _ = _compare(context, manifest)
    answer = ManifestAnswer.restate(
        manifest,
        files=len(manifest.files),
        stored=len(manifest.files) - len(missing),
        complete=not missing,
        missing=missing,
        receipt=None if missing else f"/v1/campaigns/{campaign.id}/receipt?manifest_id={manifest.id}",
    )
    return answer.respond()


@router.get("/campaigns/{campaign_id}/receipt", response_model=ReceiptAnswer, responses=answers.problems(409))
def get_receipt(
    campaign: lookup.Own[Campaign],
    caller: auth.ReaderOrUploader,
    context: UsesContext,
    manifest_id: Annotated[
        models.Text | None, Query(description="One of the campaign's manifests; without it, the newest.")
    ] = None,
) -> Response:
    """Attest, signed, that every file of a manifest is stored: the card may be formatted.

    `not_covered` lists the files of the card that were not sent. The signature is Ed25519 over `receipt` in
    canonical JSON (RFC 8785); `GET /v1/signing-keys` has the public key. Keys with `read` or `upload` may.
    """
    with context.database.reading() as session:
        manifest = find_manifest(session, campaign, manifest_id)
    if manifest is None and manifest_id is not None:
        raise problems.not_found("manifest")
    if manifest is None:
        detail = "No manifest was sent to this campaign: POST what the card holds to its /manifest first."
        raise problems.Problem(interface.MANIFEST_INCOMPLETE, detail, missing=[])
    missing, stored = _compare(context, manifest)
    if missing:
        raise problems.Problem(
            interface.MANIFEST_INCOMPLETE,
            f"{len(missing)} of {len(manifest.files)} files are not stored whole. Keep the card.",
            missing=[each.dump() for each in missing[:_MOST_NAMED]],
        )
    context.signer.enrol()
    files = _list_received(manifest.files, stored)
    distinct = {file.sha256: file for file in files}.values()
    receipt = ReceiptStatement(
        type="stilb receipt 1",
        statement=_STATEMENT,
        issued_at=utc_now(),
        key_id=context.signer.key_id,
        software=f"stilb {read_version()}",
        organisation=caller.organisation_name,
        campaign_id=campaign.id,
        project_number=campaign.project_number,
        manifest_id=manifest.id,
        manifest_sha256=manifest.sha256,
        files_count=len(files),
        size_bytes=sum(file.size_bytes for file in files),
        distinct_files_count=len(distinct),
        distinct_size_bytes=sum(file.size_bytes for file in distinct),
        refused_count=sum(file.state == "refused" for file in distinct),
        withdrawn_count=sum(file.withdrawn_at is not None for file in distinct),
        files=files,
        not_covered=manifest.others,
    )
    value = context.signer.sign(write_canonical(receipt.dump()))
    answer = ReceiptAnswer(
        receipt=receipt,
        signature=ReceiptSignature(algorithm=signatures.ALGORITHM, key_id=context.signer.key_id, value=value),
    )
    return answer.respond({"Content-Disposition": f'attachment; filename="receipt-{manifest.id}.json"'})


@keys_router.get("/signing-keys", response_model=SigningKeys, responses=answers.problems(503))
def list_signing_keys(context: UsesContext, session: Session) -> Response:
    """The public keys that receipts were ever signed with, newest first. No key is needed."""
    context.signer.enrol()
    rows = session.scalars(select(SigningKey).order_by(SigningKey.created_at.desc(), SigningKey.id))
    return SigningKeys(items=[SigningKeyAnswer.restate(row) for row in rows]).respond()


def _compare(context: Context, manifest: Manifest) -> tuple[list[MissingFile], Mapping[str, Row[Any]]]:
    with context.database.reading() as session:
        stored = read_stored(session, manifest.campaign_id, {file["sha256"] for file in manifest.files})
    absent = context.files.find_absent({sha256: row.size_bytes for sha256, row in stored.items()})
    missing = []
    for file in manifest.files:
        if (row := stored.get(file["sha256"])) is None:
            reason = "not_received"
        elif file["sha256"] in absent:
            reason = "damaged"
        elif row.size_bytes != file["size_bytes"]:
            reason = "size_differs"
        else:
            continue
        missing.append(MissingFile.restate(file, reason=reason))
    return missing, stored


def _list_received(files: Sequence[Any], stored: Mapping[str, Row[Any]]) -> list[ReceivedFile]:
    first: dict[str, str] = {}
    received = []
    for file in files:
        name = first.setdefault(file["sha256"], file["name"])
        same_as = name if name != file["name"] else None
        received.append(ReceivedFile.restate(file, stored[file["sha256"]], same_as=same_as))
    return received

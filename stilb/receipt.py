"""Signed receipts: verified without the service, against a public key that is known already."""

import base64
import json
import re
import unicodedata
from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stilb import problem, transport

_TYPE = "stilb receipt 1"
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


class ReceiptInvalid(problem.Unclear):
    """The receipt, or the card beside it, is not what was signed."""


@dataclass(frozen=True)
class KnownKeys:
    """Public keys that this user has seen: the first that a key id came with counts, and stays."""

    path: Path

    def read(self) -> dict[str, dict[str, str]]:
        """Return the keys by their ids: PEM, and the service that showed each."""
        try:
            return dict(json.loads(self.path.read_text(encoding="utf-8")))
        except FileNotFoundError:
            return {}

    def keep(self, items: list[dict[str, str]], url: str) -> None:
        """Add keys that are not known yet."""
        known = self.read()
        new = {item["id"]: {"public_key": item["public_key"], "url": url} for item in items}
        if new.keys() - known.keys():
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            transport.write_whole(self.path, json.dumps(new | known, indent=1))


def read_keys(text: str) -> list[str]:
    """Return the public keys in PEM, or in what ``GET /v1/signing-keys`` answers."""
    if "-----BEGIN" in text and not text.lstrip().startswith("{"):
        return [text]
    try:
        return [str(item["public_key"]) for item in json.loads(text)["items"]]
    except (ValueError, KeyError, TypeError) as error:
        raise problem.Unclear("A public key is PEM, or the answer of /v1/signing-keys.") from error


def verify_receipt(signed: Mapping[str, Any], public_keys: list[str]) -> dict[str, Any]:
    """Return what a receipt attests, if one of these keys signed it; ``ReceiptInvalid`` otherwise."""
    # half of a command's start, and this alone needs it
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey  # noqa: PLC0415
    from cryptography.hazmat.primitives.serialization import load_pem_public_key  # noqa: PLC0415

    try:
        receipt = dict(signed["receipt"])
        text = json.dumps(receipt, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
        signature = base64.b64decode(signed["signature"]["value"], validate=True)
    except (KeyError, TypeError, ValueError) as error:
        raise ReceiptInvalid("This is not a receipt.") from error
    if receipt.get("type") != _TYPE or signed["signature"].get("algorithm") != "Ed25519":
        raise ReceiptInvalid("This is not a receipt that this version of stilb can verify.")
    for pem in public_keys:
        try:
            key = load_pem_public_key(pem.encode())
        except (ValueError, UnsupportedAlgorithm) as error:
            raise problem.Unclear(f"The public key cannot be read: {error}") from error
        if not isinstance(key, Ed25519PublicKey):
            raise problem.Unclear("The public key is not an Ed25519 key.")
        try:
            key.verify(signature, text.encode("utf-8", "replace"))
        except InvalidSignature:
            continue
        return receipt
    raise ReceiptInvalid("The receipt is not what this key signed: it was changed, or signed by another key.")


def compare_card(receipt: Mapping[str, Any], folder: Path, *, ours: Collection[Path] = ()) -> list[str]:
    """Return how a folder differs from a receipt: what would be lost with it, but for files of ours."""
    # a copy on another system may put the same letters together in another way
    listed = defaultdict[str, set[str]](set)
    for each in receipt["files"]:
        listed[unicodedata.normalize("NFC", each["name"])].add(each["sha256"])
    found = []
    for path in (each for each in list_files(folder) if each.resolve() not in ours):
        name = plain_name(path.relative_to(folder).as_posix())
        if (hashes := listed.get(unicodedata.normalize("NFC", name))) is None:
            found.append(f"{name}: not in the receipt")
        elif transport.hash_file(path) not in hashes:
            found.append(f"{name}: not the file of the receipt")
    return found


def list_files(folder: Path) -> list[Path]:
    """Return all files of a folder, hidden ones too."""
    return sorted(path for path in folder.rglob("*") if path.is_file())


def plain_name(name: str) -> str:
    """Return a name as text that every system can write: what is not UTF-8, or controls, is replaced."""
    return _CONTROL.sub("\ufffd", name.encode("utf-8", "replace").decode())[:1000]

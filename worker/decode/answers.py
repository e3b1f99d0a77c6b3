"""Answers of a decoder, checked as a stranger's; not for the zygote, whose modules each cell copies."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from radiometry import findings, records
from radiometry.frame import Frame, FrameHeader, multispectral
from radiometry.frame.proof import Proof
from radiometry.methods.findings import FINDINGS
from worker.decode import limits, messages

_T = TypeVar("_T")
_Place = Annotated[int, Field(strict=True)]
_Side = Annotated[int, Field(strict=True, gt=0, le=limits.MAX_SIDE_PX)]
_Level = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class _Told(records.Record):
    """A frame without its samples."""

    row0: _Place
    col0: _Place
    height_px: _Side
    width_px: _Side
    cfa: str
    black_level_dn: tuple[_Level, ...]
    white_level_dn: tuple[_Level, ...]


_HEADER: Final = TypeAdapter(FrameHeader)
_PROOF: Final = TypeAdapter(Proof)
_FRAME: Final = TypeAdapter(_Told)
_SITES: Final = {"RGGB": 4, "GBRG": 4, "BGGR": 4, "GRBG": 4, "grey": 1, "rgb": 3}
_MAX_MESSAGE: Final = 1000


def check_refusal(answer: dict[str, Any]) -> findings.InputRejected:
    refused = answer["refused"]
    if not isinstance(refused, dict) or not isinstance(refused.get("message"), str):
        raise messages.BrokenMessageError("a refusal without a reason")
    if (found := FINDINGS.get(str(refused.get("code")))) is None or found.severity != "error":
        raise messages.BrokenMessageError("a refusal with an unknown code")
    return findings.InputRejected(found, refused["message"][:_MAX_MESSAGE])


def check_header(answer: dict[str, Any]) -> FrameHeader:
    header = _validate(_HEADER, answer, "header")
    texts = list(_texts(asdict(header)))
    plausible = (
        header.cfa in _SITES
        and len(header.black_level_dn) == len(header.white_level_dn) == _SITES[header.cfa]
        and 0 < header.width_px <= limits.MAX_SIDE_PX
        and 0 < header.height_px <= limits.MAX_SIDE_PX
        and header.width_px * header.height_px <= limits.MAX_FRAME_PX
        and header.band_rows >= header.first_band_rows >= 1
        and abs(header.latitude_deg or 0.0) <= 90
        and abs(header.longitude_deg or 0.0) <= 180
        and all(math.isfinite(level) for level in (*header.black_level_dn, *header.white_level_dn))
        and (header.multispectral is None or header.multispectral.system in multispectral.CAMERAS)
        and all(len(text) <= limits.MAX_TEXT and text.isprintable() for text in texts)
    )
    if not plausible:
        raise messages.BrokenMessageError("a header that cannot be")
    return header


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _texts(part)


def check_frame(answer: dict[str, Any], body: memoryview, window: tuple[int, int, int, int]) -> Frame:
    told = _validate(_FRAME, answer, "frame")
    sites, (row0, col0, height, width) = _SITES.get(told.cfa), window
    shape = (height, width, 3) if told.cfa == "rgb" else (height, width)
    if len(body) != 2 * math.prod(shape) or (told.row0, told.col0) != (row0, col0):
        raise messages.BrokenMessageError("a frame of another size than was asked for")
    if not len(told.black_level_dn) == len(told.white_level_dn) == sites:
        raise messages.BrokenMessageError("levels for other sites")
    return Frame(samples_dn=np.frombuffer(body, np.uint16).reshape(shape), **vars(told))


def check_preview(body: memoryview) -> bytes:
    preview = bytes(body)
    if not preview.startswith(b"\x89PNG\r\n\x1a\n"):
        raise messages.BrokenMessageError("a preview that is no PNG")
    return preview


def check_proof(answer: dict[str, Any]) -> Proof:
    proof = _validate(_PROOF, answer, "proof")
    shares = (*proof.wholeness.zero_share, *proof.wholeness.below_share)
    if not (all(0.0 <= share <= 1.0 for share in shares) and 0 <= proof.highest_dn < 1 << 16):
        raise messages.BrokenMessageError("a proof that cannot be")
    return proof


def _validate(form: TypeAdapter[_T], answer: dict[str, Any], name: str) -> _T:
    try:
        return form.validate_python(answer.get(name))
    except ValidationError as error:
        raise messages.BrokenMessageError(f"a {name} that is none") from error

"""Data that a certificate is checked against: an export in a folder, or one fetched from a server."""

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import stilb
from radiometry.records import Record
from stilb.export import CERTIFICATE, PANELS, READINGS, REGIONS, STATUS, frame_path, name_issued

Node = dict[str, Any]


class Unusable(Exception):  # noqa: N818  it says what was found
    """There is no certificate, or no data, where it was said to be."""


class Data(Record):
    """An export, read.

    ``certificate``: its own copy, which need not be the one that is checked. ``status``: of the version when
    it was exported, with the hashes of what was issued; empty in exports from before there was any.
    """

    folder: Path
    certificate: Node
    status: Node
    readings: list[Node]
    panels: list[Node]
    regions: list[Node]

    def find_copy(self, certificate: Node) -> Node:
        """Return the data's own copy of a certificate: of an amendment the amendment."""
        amends = certificate.get("issued", {}).get("amends")
        return self.read_issued(amends) if amends else self.certificate

    def read_issued(self, issued: Node) -> Node:
        """Read the original certificate, or an amendment."""
        read: Node = _read_json(self.folder / f"{name_issued(issued)}.json")
        return read


def find_frame(folder: Path, frame: Node) -> Path:
    """Where a frame lies in an export, by its hash and name; earlier exports named some differently."""
    path = folder / frame_path(frame)
    return path if path.exists() else next(path.parent.glob(f"{frame['sha256'][:12]}-*"), path)


def read_certificate(place: str, key: str) -> Node:
    """Read a certificate or the record of a measurement, from a file or a server's address."""
    if not is_address(place):
        return _checked(_read_json(Path(place)), place)
    server, path = split_address(place)
    parts = path.strip("/").split("/")
    amendment = int(dict(parse_qsl(urlsplit(place).query)).get("amendment", 0))
    with stilb.Client(server, key) as client:
        match parts:
            case ["v1", "calibrations", calibration_id, _]:
                return _checked(client.certificate(calibration_id, amendment=amendment), place)
            case ["v1", "measurements", measurement_id, *_]:
                return _checked(client.measurement_record(measurement_id), place)
    raise Unusable(
        f"{place} is not the address of a certificate (.../v1/calibrations/<id>/certificate.json) "
        "or of a measurement (.../v1/measurements/<id>)"
    )


@contextmanager
def open_export(place: str, key: str, of: str, *, measured: bool = False) -> Iterator[Path]:
    """Return the folder of an export; one on a server is fetched for as long as this context."""
    if not is_address(place):
        yield Path(place)
        return
    server, _ = split_address(place)
    with tempfile.TemporaryDirectory(prefix="stilb-verify-") as folder, stilb.Client(server, key) as client:
        yield client.export_measurement(of, folder) if measured else client.export(of, folder)


def is_measurement(certificate: Node) -> bool:
    """Return True if what was read is the record of a measurement."""
    return "calibration" in certificate


def is_address(place: str) -> bool:
    """Return True if a place is on a server."""
    return place.startswith(("http://", "https://"))


def split_address(place: str) -> tuple[str, str]:
    """The server and the path on it."""
    parts = urlsplit(place)
    return f"{parts.scheme}://{parts.netloc}", parts.path


def read_folder(folder: Path) -> Data:
    """Read the export of a version."""
    certificate = _read_json(folder / CERTIFICATE)
    return Data(
        folder=folder,
        certificate=certificate,
        status=_read_json(folder / STATUS) if (folder / STATUS).exists() else {},
        readings=_read_json(folder / READINGS),
        panels=_read_json(folder / PANELS) if certificate.get("panels") else [],
        regions=_read_json(folder / REGIONS),
    )


def _read_json(path: Path) -> Any:  # noqa: ANN401  JSON
    try:
        return json.loads(path.read_bytes(), parse_constant=_refuse)
    except OSError as error:
        raise Unusable(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise Unusable(f"{path} is no JSON: {error}") from error


def _refuse(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _checked(certificate: Any, place: str) -> Node:  # noqa: ANN401  JSON
    if not isinstance(certificate, dict) or certificate.get("schema_version") != 1:
        raise Unusable(f"{place} is no certificate that this verifier knows (schema_version 1)")
    return certificate

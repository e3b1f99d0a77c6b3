"""Rigs: cameras mounted together, whose relative orientation a method finds from versions of each."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from radiometry.fitting.evidence import Quantity
from radiometry.specification.certificate import CertificateText


@dataclass(frozen=True, kw_only=True)
class RigMember:
    """Version of one camera of a rig, with the frames that it was made from.

    Attributes
    ----------
    serial : str
        Serial number of the camera.
    fitted : object
        Result of the version.
    params : object
        Parameters of the version.
    rows : tuple
        Frames, as the fit read them.
    """

    serial: str
    fitted: Any
    params: Any
    rows: tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class RigExport:
    """Form in which another program reads a rig.

    ``write`` : ``(orientation, members, name) -> str``
    """

    filename: str
    media_type: str
    operation: str
    description: str
    label: str
    write: Callable[[Any, Sequence[RigMember], str], str]


@dataclass(frozen=True, kw_only=True)
class RigSpec:
    """Orientation of rigs by a method.

    Attributes
    ----------
    result : type
        Type of an orientation.
    orient : callable
        ``(members) -> orientation``, the reference first. Raises InputRejected.
    count_shared : callable
        ``(member, member) -> int``, how many triggers have a picture of both.
    list_quantities : callable
        ``(orientation) -> mapping`` from (camera, name) to Quantity, what is compared between sets.
    certificate : CertificateText
        Certificate text.
    exports : tuple of RigExport
        Forms in which other programs read an orientation.
    """

    result: type[Any]
    orient: Callable[[Sequence[RigMember]], Any]
    count_shared: Callable[[RigMember, RigMember], int]
    list_quantities: Callable[[Any], Mapping[tuple[str, str], Quantity]]
    certificate: CertificateText
    exports: tuple[RigExport, ...]

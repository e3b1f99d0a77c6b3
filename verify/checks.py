"""Every quantity of a certificate that the data decide, beside what the data say."""

from collections.abc import Iterator

from radiometry import methods
from stilb.export import name_issued
from stilb.transport import hash_file
from store.codec import drop_absent, encode
from store.fits import hash_content
from store.queries.calibration_record import state_budgets, state_coefficients
from store.queries.frames import name_extractor
from store.software import FIT_CODE_VERSION
from verify.compare import ABSENT, Row, compare
from verify.data import Data, Node
from verify.recompute import Recomputed, hash_region, inputs_of

_DECIDED_LATER = (
    *("validity", "published", "checklist", "gaps"),
    *("number", "issued", "approved_by", "statements"),
)
"""What may rightly have changed since a draft was handed out; what was issued stays."""


def check(certificate: Node, data: Data, found: Recomputed) -> list[Row]:
    """All rows, the same and the different, in the order of the work: software, data, figures, whole."""
    return [
        *_software(certificate),
        *_frames(found),
        *compare("readings", certificate["readings"], data.readings),
        *compare("panels", certificate["panels"], data.panels),
        *compare("regions", certificate["regions"], data.regions),
        *_regions(data),
        *_meters(certificate),
        *_figures(certificate, found),
        *_content(certificate, data, found),
        *_own_copy(certificate, data),
        *_issued_files(data),
    ]


def _software(certificate: Node) -> Iterator[Row]:
    yield from compare(
        "software",
        {name: certificate["software"].get(name, ABSENT) for name in ("stilb", "extractor")},
        {
            "stilb": FIT_CODE_VERSION,
            "extractor": name_extractor(certificate["method"], certificate.get("target")),
        },
    )


def _frames(found: Recomputed) -> Iterator[Row]:
    for frame in found.frames:
        stated, name = frame.stated, frame.stated["frame"]
        yield Row(
            group="frame files",
            quantity=f"{name} SHA-256",
            certificate=stated["sha256"],
            recomputed=frame.sha256 or frame.trouble,
        )
        if frame.row is None:
            yield Row(group="frames", quantity=name, certificate="can be read", recomputed=frame.trouble)
            continue
        exposure = drop_absent(encode(frame.exposure)) if frame.exposure else {}
        yield from compare("exposures", stated.get("exposure", {}), exposure, name)
        yield from compare("frame statistics", {key: stated[key] for key in frame.signal}, frame.signal, name)


def _regions(data: Data) -> Iterator[Row]:
    for region in data.regions:
        yield Row(
            group="regions",
            quantity="SHA-256 of its corners",
            certificate=region["sha256"],
            recomputed=hash_region(region),
        )


def _meters(certificate: Node) -> Iterator[Row]:
    """The uncertainty that went into the fit is the one on the meter's certificate."""
    meters = {meter["id"]: meter.get("certificate", {}) for meter in certificate["meters"]}
    for index, reading in enumerate(certificate["readings"]):
        if "meter_id" in reading:
            for name in ("expanded_uncertainty_rel", "coverage_factor"):
                yield Row(
                    group="meter certificates",
                    quantity=f"[{index}].{name}",
                    certificate=meters.get(reading["meter_id"], {}).get(name, ABSENT),
                    recomputed=reading.get(name, ABSENT),
                )


def _figures(certificate: Node, found: Recomputed) -> Iterator[Row]:
    if found.fit is None:
        yield Row(group="fit", quantity="fit", certificate="was possible", recomputed=found.trouble)
        return
    stated = dict(certificate["result"])
    stated["points"] = [_without(point, "frame_id") for point in stated["points"]]
    result = drop_absent(encode(found.fit))
    for name in sorted(stated.keys() | result.keys()):
        yield from compare(name, stated.get(name, ABSENT), result.get(name, ABSENT), name)
    method = certificate["method"]
    figures = [encode(figure) for figure in methods.get_method(method).list_coefficients(found.fit)]
    stored = encode(found.fit)
    coefficients = state_coefficients(method, stored, figures)
    yield from compare("coefficients", certificate["coefficients"], coefficients, "coefficients")
    yield from compare("budgets", certificate["budgets"], state_budgets(method, stored), "budgets")
    flags = [_without(flag, "meaning") for flag in certificate["flags"]]
    yield from compare("flags in words", flags, result["flags"], "flags")


def _content(certificate: Node, data: Data, found: Recomputed) -> Iterator[Row]:
    inputs = inputs_of(certificate, found, data)
    yield Row(
        group="content hash",
        quantity="content SHA-256",
        certificate=certificate["content_sha256"],
        recomputed=hash_content(inputs, encode(found.params)),
    )


def _own_copy(certificate: Node, data: Data) -> Iterator[Row]:
    """The data bring the certificate as it was handed out with them."""
    both = certificate, data.find_copy(certificate)
    left_out = () if all("issued" in each for each in both) else _DECIDED_LATER
    kept, theirs = ({name: each[name] for name in each if name not in left_out} for each in both)
    yield from compare("the data's own certificate", kept, theirs)


def _issued_files(data: Data) -> Iterator[Row]:
    """The files of what was issued are, byte for byte, those that the service has kept."""
    for issued in data.status.get("certificates", []):
        for form in ("json", "pdf"):
            path = data.folder / f"{name_issued(issued)}.{form}"
            found = hash_file(path) if path.exists() else ABSENT
            stated = issued[f"{form}_sha256"]
            yield Row(
                group="issued files", quantity=f"{path.name} SHA-256", certificate=stated, recomputed=found
            )


def _without(node: Node, name: str) -> Node:
    return {key: value for key, value in node.items() if key != name}

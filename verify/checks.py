"""Every quantity of a certificate that the data decide, beside what the data say."""

from collections.abc import Iterator

from radiometry import methods
from stilb import export, transport
from store import codec, fits, software
from store.queries.calibration_record import state_budgets, state_coefficients
from store.queries.frames import name_extractor
from verify.compare import ABSENT, Row, compare
from verify.data import Data, Node, find_frame
from verify.recompute import Recomputed, hash_region, inputs_of

_DECIDED_LATER = (
    *("validity", "published", "checklist", "gaps"),
    *("number", "issued", "approved_by", "statements"),
)
"""What may rightly have changed since a draft was handed out; what was issued stays."""
_SIGNED = ("number", "fitted_by", "approved_by")


def check(certificate: Node, data: Data, found: Recomputed) -> list[Row]:
    """All rows, the same and the different, in the order of the work: software, data, figures, whole."""
    both = certificate, data.find_copy(certificate)
    left_out = () if all("issued" in each for each in both) else _DECIDED_LATER
    kept, theirs = ({name: each[name] for name in each if name not in left_out} for each in both)
    return [
        *_software(certificate),
        *_frames(found),
        *compare("readings", certificate["readings"], data.readings),
        *compare("panels", certificate["panels"], data.panels),
        *compare("regions", certificate["regions"], data.regions),
        *(Row("regions", "SHA-256 of its corners", roi["sha256"], hash_region(roi)) for roi in data.regions),
        *_meters(certificate),
        *_figures(certificate, found),
        Row(
            "content hash",
            "content SHA-256",
            certificate["content_sha256"],
            fits.hash_content(inputs_of(certificate, found, data), codec.encode(found.params)),
        ),
        # the data bring the certificate as it was handed out with them
        *compare("the data's own certificate", kept, theirs),
        *_issued_files(data),
        *_standing(certificate, data),
        *_sums(certificate, data),
    ]


def _software(certificate: Node) -> Iterator[Row]:
    extractor = name_extractor(certificate["method"], certificate.get("target"))
    found = {"stilb": software.FIT_CODE_VERSION, "extractor": extractor}
    yield from compare("software", {name: certificate["software"].get(name, ABSENT) for name in found}, found)


def _frames(found: Recomputed) -> Iterator[Row]:
    for frame in found.frames:
        stated, name = frame.stated, frame.stated["frame"]
        yield Row("frame files", f"{name} SHA-256", stated["sha256"], frame.sha256 or frame.trouble)
        if frame.row is None:
            yield Row("frames", name, "can be read", frame.trouble)
            continue
        exposure = codec.drop_absent(codec.encode(frame.exposure)) if frame.exposure else {}
        yield from compare("exposures", stated.get("exposure", {}), exposure, name)
        yield from compare("frame statistics", {key: stated[key] for key in frame.signal}, frame.signal, name)


def _meters(certificate: Node) -> Iterator[Row]:
    """The uncertainty that went into the fit is the one on the meter's certificate."""
    meters = {meter["id"]: meter.get("certificate", {}) for meter in certificate["meters"]}
    for index, reading in enumerate(certificate["readings"]):
        if "meter_id" in reading:
            for name in ("expanded_uncertainty_rel", "coverage_factor"):
                stated = meters.get(reading["meter_id"], {}).get(name, ABSENT)
                yield Row("meter certificates", f"[{index}].{name}", stated, reading.get(name, ABSENT))


def _figures(certificate: Node, found: Recomputed) -> Iterator[Row]:
    if found.fit is None:
        yield Row("fit", "fit", "was possible", found.trouble)
        return
    stated = dict(certificate["result"])
    stated["points"] = [_without(point, "frame_id") for point in stated["points"]]
    result = codec.drop_absent(codec.encode(found.fit))
    for name in sorted(stated.keys() | result.keys()):
        yield from compare(name, stated.get(name, ABSENT), result.get(name, ABSENT), name)
    method = certificate["method"]
    figures = [codec.encode(figure) for figure in methods.get_method(method).list_coefficients(found.fit)]
    stored = codec.encode(found.fit)
    coefficients = state_coefficients(method, stored, figures)
    yield from compare("coefficients", certificate["coefficients"], coefficients, "coefficients")
    yield from compare("budgets", certificate["budgets"], state_budgets(method, stored), "budgets")
    flags = [_without(flag, "meaning") for flag in certificate["flags"]]
    yield from compare("flags in words", flags, result["flags"], "flags")


def _issued_files(data: Data) -> Iterator[Row]:
    """The files of what was issued are, byte for byte, those that the service has kept."""
    for issued in data.status.get("certificates", []):
        for form in ("json", "pdf"):
            path = data.folder / f"{export.name_issued(issued)}.{form}"
            found = transport.hash_file(path) if path.exists() else ABSENT
            yield Row("issued files", f"{path.name} SHA-256", issued[f"{form}_sha256"], found)


def _standing(certificate: Node, data: Data) -> Iterator[Row]:
    """Compare status.json with the certificates: nobody has signed it, but much of it follows from them."""
    if not (status := data.status):
        return
    yield Row("status.json", "id", certificate["calibration_id"], status.get("id", ABSENT))
    for name in ("method", "version"):
        yield Row("status.json", name, certificate[name], status.get(name, ABSENT))
    if "certificates" not in status:
        return
    acts = []
    for index, listed in enumerate(status["certificates"]):
        held = data.read_issued(listed)
        acts.append(act := held["published"][-1])
        said: Node = {name: held[name] for name in _SIGNED if name in held}
        said |= {"issued_at": held["issued"]["at"], "reason": act["reason"]}
        found = {name: listed[name] for name in listed if name in {*said, *_SIGNED}}
        yield from compare("status.json", said, found, f"certificates[{index}]")
    stated, state = status.get("state", ABSENT), "published" if acts else "draft"
    state = "revoked" if "revoked_reason" in status else state
    yield Row(
        "status.json", "state", stated if (state, stated) == ("published", "superseded") else state, stated
    )
    if "valid_from" in status:
        start, end = min(act["valid_from"] for act in acts), max(act.get("valid_to", "~") for act in acts)
        is_within = start <= status["valid_from"] and status.get("valid_to", "~") <= end
        stands = f"{status['valid_from']} to {status.get('valid_to', 'open')}"
        most = f"within {start} to {end.replace('~', 'open')}"
        yield Row("status.json", "validity", stands if is_within else most, stands)


def _sums(certificate: Node, data: Data) -> Iterator[Row]:
    """Compare SHA256SUMS with the certificate, where the export has it: by it others check the frames."""
    if (path := data.folder / "SHA256SUMS").exists():
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        found = {name: sha256 for sha256, _, name in (line.partition("  ") for line in lines)}
        frames = certificate["frames"]
        paths = [find_frame(data.folder, frame).relative_to(data.folder).as_posix() for frame in frames]
        stated = {name: frame["sha256"] for name, frame in zip(paths, frames, strict=True)}
        yield from compare("SHA256SUMS", stated, found)


def _without(node: Node, name: str) -> Node:
    return {key: value for key, value in node.items() if key != name}

"""Recomputation from the bytes of frames, readings and panels, with the code that the service runs."""

from collections.abc import Callable, Iterable
from dataclasses import asdict, fields, replace
from typing import Any

from radiometry import findings, methods, records
from radiometry.fitting.evidence import Extracted, FrameEvidence, Region
from radiometry.frame import FrameHeader, roi
from radiometry.frame.exposure import Camera, Exposure, SuppliedExposure, accept_frame
from radiometry.frame.statistics import ChannelStatistics, measure_signal
from radiometry.specification import application, method
from stilb.transport import hash_file
from store.codec import decode, drop_absent, encode
from store.queries.campaigns import Drawing
from verify.compare import take_stated
from verify.data import Data, Node, find_frame
from worker.decode.pool import DecoderCrashed, DecoderPool

OnFrame = Callable[[int, int], None]


class FoundFrame(records.Record):
    """A frame of the certificate, read again. ``trouble``: why it could not be, else "".

    ``row`` : as the method's fit wants it, None where it could not be read
    """

    stated: Node
    sha256: str
    trouble: str
    exposure: Exposure | None = None
    row: Any = None
    signal: Node


class Recomputed(records.Record):
    """``fit`` is None where the data allow none; ``trouble`` then says why."""

    params: Any
    frames: list[FoundFrame]
    readings: list[Any]
    fit: Any
    trouble: str


def recompute(certificate: Node, data: Data, decoders: DecoderPool, on_frame: OnFrame) -> Recomputed:
    """Decode, measure and fit again, with the certificate's parameters and the data's frames and readings."""
    spec = methods.get_method(certificate["method"])
    params = decode(spec.params, certificate["parameters"])
    regions = {region["sha256"]: region for region in data.regions}
    frames = []
    for number, stated in enumerate(certificate["frames"], start=1):
        frames.append(_read(stated, certificate, data, regions.get(stated["roi_sha256"]), decoders))
        on_frame(number, len(certificate["frames"]))
    readings = _readings(spec, data)
    try:
        fit = spec.fit([frame.row for frame in frames if frame.row], readings, params)
    except findings.InputRejected as refusal:
        return Recomputed(params=params, frames=frames, readings=readings, fit=None, trouble=refusal.message)
    return Recomputed(params=params, frames=frames, readings=readings, fit=fit, trouble="")


def _readings(spec: method.MethodSpec, data: Data) -> list[Any]:
    if spec.reference is None:
        return []
    rows = data.readings
    if spec.reference == "panel":
        rows = [
            {
                **band,
                "panel": panel["serial"],
                "measured_on": panel["measured_on"],
                "from_file": True if band.get("origin") == "file" else None,
            }
            for panel in data.panels
            for band in sorted(panel["bands"], key=lambda each: str(each["band"]))
        ]
    return [
        decode(spec.reading, {each.name: row.get(each.name) for each in fields(spec.reading)}) for row in rows
    ]


def _read(
    stated: Node, certificate: Node, data: Data, region: Node | None, decoders: DecoderPool
) -> FoundFrame:
    path = find_frame(data.folder, stated)
    if not path.exists():
        return FoundFrame(stated=stated, sha256="", trouble="the file is missing", signal={})
    sha256 = hash_file(path)
    if region is None or hash_region(region) != stated["roi_sha256"]:
        trouble = "its region is not among the data's"
        return FoundFrame(stated=stated, sha256=sha256, trouble=trouble, signal={})
    try:
        with decoders.hold(path):
            header = replace(decoders.read_header(path), clock_offset=stated.get("clock_offset"))
            exposure = _expose(stated, header, certificate)
            around = roi.Polygon.from_points(region["points"])
            window = roi.bounding_window(around, height_px=header.height_px, width_px=header.width_px)
            pixels = decoders.read_window(path, (window.row0, window.col0, window.height, window.width))
        spec, target = methods.get_method(certificate["method"]), certificate.get("target")
        extracted = spec.extract(
            pixels,
            _parts(region),
            header=header,
            exposure=exposure,
            target=decode(spec.target, target) if spec.target and target else None,
        )
        row = _make_row(stated, certificate, header, exposure, extracted, around)
    except (findings.InputRejected, DecoderCrashed) as refusal:
        return FoundFrame(stated=stated, sha256=sha256, trouble=refusal.message, signal={})
    signal = _signal(extracted.statistics, certificate)
    return FoundFrame(stated=stated, sha256=sha256, trouble="", exposure=exposure, row=row, signal=signal)


def hash_region(region: Node) -> str:
    """The key of a region, of one polygon or of several parts."""
    if region.get("parts"):
        return Drawing.of_parts(_parts(region)).sha256
    return roi.Polygon.from_points(region["points"]).sha256


def _parts(region: Node) -> list[Region]:
    parts = region.get("parts") or [{"name": "", "points": region["points"]}]
    return [Region(name=part["name"], polygon=roi.Polygon.from_points(part["points"])) for part in parts]


def _make_row(
    stated: Node,
    certificate: Node,
    header: FrameHeader,
    exposure: Exposure | None,
    extracted: Extracted[Any],
    around: roi.Polygon,
) -> Any:  # noqa: ANN401 (the method's own)
    spec = methods.get_method(certificate["method"])
    evidence = FrameEvidence(
        frame=stated["frame"],
        role=stated["role"],
        scene=stated.get("scene"),
        header=header,
        exposure=exposure,
        statistics=_in_order(extracted.statistics),
        # by way of JSON, as the service keeps them
        features=decode(spec.features, encode(extracted.features)) if spec.features else None,
        identified=stated.get("panel_serial"),
    )
    row = spec.make_row(evidence)
    if not certificate.get("falloff") or stated["role"] != "light" or exposure is None:
        return row
    if stated["frame"] in {exclusion["frame"] for exclusion in certificate["parameters"]["exclude"]}:
        return row
    corrector = methods.get_method(spec.corrected_by or "")
    if corrector.correction is None or not isinstance(spec.application, application.SurfaceApplication):
        raise TypeError(f"{spec.name} is not corrected by {corrector.name}")
    share = corrector.correction.average_over_polygon(
        decode(corrector.applied_type, certificate["falloff"][0]["coefficients"]),
        around,
        channels=spec.application.name_channels(header.cfa, channel=certificate["parameters"]["channel"]),
        f_number=exposure.f_number,
    )
    return replace(row, lens_share=share)


def _in_order(statistics: Iterable[ChannelStatistics]) -> tuple[ChannelStatistics, ...]:
    """In the order in which the service keeps them, which is that of every sum."""
    return tuple(sorted(statistics, key=lambda row: row.channel))


def _expose(stated: Node, header: FrameHeader, certificate: Node) -> Exposure | None:
    """The exposure as the file says it; what was typed in because the file is silent is taken over."""
    said, item = stated.get("exposure", {}), certificate["item"]
    supplied = {
        name: said[name]
        for name in ("exposure_time_s", "f_number", "iso")
        if said.get(f"{name.removesuffix('_s')}_origin") == "supplied"
    }
    camera = Camera(make=item["make"], model=item["model"], serial=item["serial"])
    return accept_frame(
        header, role=stated["role"], supplied=SuppliedExposure(**supplied), camera=camera
    ).exposure


def _signal(statistics: tuple[ChannelStatistics, ...], certificate: Node) -> Node:
    ordered = _in_order(statistics)
    rows = {"statistics": [drop_absent(asdict(row)) for row in ordered]}
    if "channel" not in certificate["parameters"]:
        return rows
    signal = measure_signal(ordered, channel=certificate["parameters"]["channel"])
    return {
        "signal_dn": signal.value_dn,
        "signal_standard_uncertainty_dn": signal.standard_uncertainty_dn,
        **rows,
    }


def inputs_of(certificate: Node, found: Recomputed, data: Data) -> Node:
    """Return what a version's content hash is taken over, made of what was found."""
    frames = []
    for frame in found.frames:
        stated = frame.stated
        names = ("frame", "role", "scene", "clock_offset", "roi_sha256")
        row = {name: stated[name] for name in names if name in stated} | {"sha256": frame.sha256}
        if frame.exposure:
            row["exposure"] = take_stated(stated["exposure"], encode(frame.exposure))
        frames.append(row)
    parts = {region["sha256"]: region["parts"] for region in data.regions if region.get("parts")}
    return {
        "frames": frames,
        "readings": [encode(reading) for reading in found.readings],
        **_references(certificate, data),
        **({"target": certificate["target"]} if certificate.get("target") else {}),
        **({"roi_parts": parts} if parts else {}),
        "rois": {region["sha256"]: region["points"] for region in data.regions},
        "extractor": certificate["software"]["extractor"],
    }


def _references(certificate: Node, data: Data) -> Node:
    """Return what the readings were made with, and what the signals were corrected with."""
    spec = methods.get_method(certificate["method"])
    falloff = certificate.get("falloff")
    names = ("kind", "make", "model", "serial", "certificate")
    meters = [{name: meter[name] for name in names if name in meter} for meter in certificate["meters"]]
    meters.sort(key=lambda meter: [meter[name] for name in names[:4]])
    return {
        **({"meters": meters} if spec.reference == "meter" else {}),
        **({"panels": data.panels} if spec.reference == "panel" else {}),
        **({spec.corrected_by: falloff} if falloff and spec.corrected_by else {}),
    }

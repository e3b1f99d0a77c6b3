"""From the bytes of the frames and the readings to the figures, with the code that the service runs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from pydantic import TypeAdapter

from radiometry.acceptance import Camera, SuppliedExposure, accept_frame
from radiometry.errors import InputRejected
from radiometry.exposure import Exposure
from radiometry.frame import FrameHeader
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.methods import luminance
from radiometry.roi import Polygon, bounding_window
from radiometry.statistics import ChannelStatistics, measure_signal
from stilb.export import hash_file
from store.codec import drop_absent, encode, encode_statistics
from verify.data import Data, Node
from worker.decode.pool import DecoderCrashed, DecoderPool

_PARAMS = TypeAdapter(Params)
_READING = TypeAdapter(Reading)

OnFrame = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class FoundFrame:
    """A frame of the certificate, read again. ``trouble``: why it could not be, else ""."""

    stated: Node
    sha256: str
    trouble: str
    row: FrameRow | None
    signal: Node


@dataclass(frozen=True, kw_only=True)
class Recomputed:
    """``fit`` is None where the data allow none; ``trouble`` then says why."""

    params: Params
    frames: list[FoundFrame]
    readings: list[Reading]
    fit: luminance.Fit | None
    trouble: str


def recompute(certificate: Node, data: Data, decoders: DecoderPool, on_frame: OnFrame) -> Recomputed:
    """Decode, measure and fit again, with the certificate's parameters and the data's frames and readings."""
    params = _PARAMS.validate_python(certificate["parameters"])
    regions = {region["sha256"]: Polygon.from_points(region["points"]) for region in data.regions}
    frames = []
    for number, stated in enumerate(certificate["frames"], start=1):
        frames.append(_read(stated, certificate, data, regions, decoders))
        on_frame(number, len(certificate["frames"]))
    readings = _readings(data.readings)
    try:
        fit = luminance.fit([frame.row for frame in frames if frame.row], readings, params)
    except InputRejected as refusal:
        return Recomputed(params=params, frames=frames, readings=readings, fit=None, trouble=refusal.message)
    return Recomputed(params=params, frames=frames, readings=readings, fit=fit, trouble="")


def _readings(rows: Iterable[Node]) -> list[Reading]:
    names = Reading.__dataclass_fields__.keys()
    return [_READING.validate_python({name: row.get(name) for name in names}) for row in rows]


def _read(
    stated: Node, certificate: Node, data: Data, regions: dict[str, Polygon], decoders: DecoderPool
) -> FoundFrame:
    path = data.path(stated)
    if not path.exists():
        return FoundFrame(stated=stated, sha256="", trouble="the file is missing", row=None, signal={})
    sha256 = hash_file(path)
    region = regions.get(stated["roi_sha256"])
    if region is None or region.sha256 != stated["roi_sha256"]:
        trouble = "its region is not among the data's"
        return FoundFrame(stated=stated, sha256=sha256, trouble=trouble, row=None, signal={})
    try:
        header = decoders.read_header(path)
        window = bounding_window(region, height_px=header.height_px, width_px=header.width_px)
        pixels = decoders.read_window(path, (window.row0, window.col0, window.height, window.width))
        statistics = luminance.extract(pixels, region)
        exposure = _expose(stated, header, certificate["item"])
    except (InputRejected, DecoderCrashed) as refusal:
        return FoundFrame(stated=stated, sha256=sha256, trouble=refusal.message, row=None, signal={})
    row = FrameRow(
        frame=stated["frame"],
        role=stated["role"],
        scene=stated.get("scene"),
        exposure=exposure,
        statistics=statistics,
        rendered=header.rendered,
        gain_maps=tuple(opcode.sha256 for opcode in header.opcodes if opcode.name == "GainMap"),
    )
    signal = _signal(statistics, channel=certificate["parameters"]["channel"])
    return FoundFrame(stated=stated, sha256=sha256, trouble="", row=row, signal=signal)


def _expose(stated: Node, header: FrameHeader, item: Node) -> Exposure:
    """The exposure as the file says it; what was typed in because the file is silent is taken over."""
    said = stated["exposure"]
    supplied = {
        name: said[name]
        for name in ("exposure_time_s", "f_number", "iso")
        if said.get(f"{name}_origin") == "supplied"
    }
    camera = Camera(make=item["make"], model=item["model"], serial=item["serial"])
    accepted = accept_frame(
        header, role=stated["role"], supplied=SuppliedExposure(**supplied), camera=camera
    ).exposure
    assert accepted is not None  # noqa: S101  narrows the type: only a chart has none, and no fit takes charts
    return accepted


def _signal(statistics: tuple[ChannelStatistics, ...], *, channel: str) -> Node:
    # in the order in which the service keeps them, which is that of the sum
    ordered = sorted(statistics, key=lambda row: row.channel)
    signal = measure_signal(ordered, channel=channel)
    return {
        "signal_dn": signal.value_dn,
        "signal_standard_uncertainty_dn": signal.standard_uncertainty_dn,
        "statistics": [drop_absent(encode_statistics(row)) for row in ordered],
    }


def inputs_of(certificate: Node, found: Recomputed, data: Data) -> Node:
    """What a version's content hash is taken over, made of what was found."""
    frames = []
    for frame in found.frames:
        stated = frame.stated
        frames.append(
            {
                "frame": stated["frame"],
                "sha256": frame.sha256,
                "role": stated["role"],
                **({"scene": stated["scene"]} if "scene" in stated else {}),
                "exposure": encode(frame.row.exposure) if frame.row else {},
                "roi_sha256": stated["roi_sha256"],
            }
        )
    return {
        "frames": frames,
        "readings": [encode(reading) for reading in found.readings],
        "meters": _meters_of(certificate),
        "rois": {region["sha256"]: region["points"] for region in data.regions},
        "extractor": certificate["software"]["extractor"],
    }


def _meters_of(certificate: Node) -> list[Node]:
    names = ("kind", "make", "model", "serial", "certificate")
    meters = [{name: meter[name] for name in names if name in meter} for meter in certificate["meters"]]
    return sorted(meters, key=lambda meter: [meter[name] for name in names[:4]])

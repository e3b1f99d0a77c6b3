"""Checklist at the end of the luminance procedure, in the words of the print, ticked where the record can."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Final, Literal

from radiometry.drawing.text import name_few, sort_naturally, write_exposure
from radiometry.records import Record

Source = Literal["campaign", "frames", "readings", "region", "statistics", "version"]

ISOS: Final = (3200.0, 6400.0, 12800.0, 25600.0)
F_NUMBERS: Final = (1.7, 16.0)
FEWEST_LEVELS: Final = 3  # As many as a fit needs; the procedure leaves the number to its user
_MOST_NAMES = 6


class Item(Record):
    """One line of the checklist."""

    key: str  # Stable key under which ticks are stored
    section: str  # Heading of the section
    text: str  # Text of the print


def _read_items(text: str) -> Iterator[Item]:
    section = ""
    for line in text.splitlines():
        key, _, said = line.strip().partition(": ")
        if said:
            yield Item(key=key, section=section, text=said)
        else:
            section = line


ITEMS: tuple[Item, ...] = tuple(
    _read_items(files(__package__).joinpath("checklist.txt").read_text(encoding="utf-8"))
)


class FrameFacts(Record):
    """One frame that was read."""

    name: str
    role: str  # "light" or "dark"
    scene: str | None  # Name of the light level
    container: str  # File format, as in `FrameHeader`
    rendered: bool  # True if the frame is a converted image
    manual: bool | None  # True if the file states manual exposure; None if it does not state the mode
    exposure_time_s: float
    f_number: float
    iso: float
    typed_in: tuple[str, ...]  # Names of the exposure values that the file lacks and a person entered
    extracted: bool  # True if its statistics in its present region exist


class IsoFacts(Record):
    """Result of a version for one ISO value."""

    iso: float
    model: str  # Name of the fitted model
    luminance_k: float  # Coefficient K and its standard uncertainty, in `luminance_k_unit`
    luminance_k_standard_uncertainty: float
    luminance_k_unit: str
    dark_signal_dn: float
    dark_frames: int  # Number of frames whose median is the dark signal
    points: int


class VersionFacts(Record):
    """A calibration version of the campaign."""

    version: int
    isos: tuple[IsoFacts, ...]  # Results, one per ISO value


class Facts(Record):
    """A campaign."""

    project_number: str | None  # Number of the project, if recorded
    started_on: str | None  # Date and time of the start, if recorded
    started_at: str | None
    recorder: str | None  # Person who records, if recorded
    frames: tuple[FrameFacts, ...]  # Light and dark frames, in the order of their names
    unread: tuple[str, ...]  # Names of the frames that are not read yet
    readings: Mapping[str, tuple[float, ...]]  # Valid luminance readings by scene [cd/m2]
    # Corners [x, y] of the campaign's region [px]; empty if none was drawn
    region: tuple[tuple[float, float], ...]
    version: VersionFacts | None  # Newest version that was not revoked


class Finding(Record):
    """State of one item according to the record."""

    done: bool  # True if the record proves the item
    sentence: str  # The evidence if `done`, otherwise what is missing
    source: Source  # Part of the record from which the state follows, and whose age is the tick's


def find(facts: Facts) -> dict[str, Finding]:
    """Evaluate every item that can be decided from the record.

    Steps that the print [1] does by hand in ImageJ are done by the extraction
    here; their evidence states this.

    [1] Standard operating procedure "Drone Camera Calibration", procedure checklist
    """
    return _general(facts) | _scenes(facts) | _frames(facts) | _extraction(facts) | _dark(facts) | _fit(facts)


def _judge(source: Source, lacking: str, evidence: str) -> Finding:
    return Finding(done=not lacking, sentence=lacking or evidence, source=source)


def _general(facts: Facts) -> dict[str, Finding]:
    said = {
        "project_number": facts.project_number,
        "date": facts.started_on,
        "time": facts.started_at,
        "recorder": facts.recorder,
    }
    return {
        f"general_{key}": _judge("campaign", "" if value else "Not recorded.", f"{value}.")
        for key, value in said.items()
    }


def _scenes(facts: Facts) -> dict[str, Finding]:
    dark, levels = _of_role(facts, "dark"), _levels(facts)
    unmeasured = [level for level in levels if level not in facts.readings]
    return {
        "scenes_levels": _judge(
            "frames",
            _lack_of_levels(levels, dark),
            f"{len(levels)} light levels were photographed: {', '.join(levels)}; "
            f"and the lamp off in {_list(dark)}.",
        ),
        "scenes_luminance_readings": _judge(
            "readings",
            ("" if levels else "No light level has been photographed yet.")
            or (unmeasured and f"Without a luminance reading: {', '.join(unmeasured)}.")
            or "",
            "; ".join(f"{level}: {_cd(facts.readings.get(level, ()))}" for level in levels) + ".",
        ),
    }


def _frames(facts: Facts) -> dict[str, Finding]:
    light, levels = _of_role(facts, "light"), _levels(facts)
    both = (*light, *_of_role(facts, "dark"))
    automatic = [frame for frame in both if not frame.manual]
    other = [frame for frame in both if frame.container != "dng" or frame.rendered]
    typed = [frame for frame in both if frame.typed_in]
    none_yet, named = _lack_of_frames(facts, both), _list(both)
    findings = {
        "settings_exposure_manual": (
            none_yet or (automatic and f"Not said to be manual: {_list(automatic)}."),
            f"The files say that the exposure was manual: {named}.",
        ),
        "settings_format_dng": (
            none_yet or (other and f"Not raw DNG: {_list(other)}."),
            f"Every light and dark frame is a raw DNG: {named}.",
        ),
        "shooting_iso_and_apertures": (
            _lack_of_frames(facts, light) or _lack_of_settings(light, levels),
            "; ".join(_format_settings(iso, _at(light, iso)) for iso in _isos(light)) + ".",
        ),
        "shooting_every_combination": (
            _lack_of_frames(facts, light) or _lack_of_combination(light, levels),
            (
                f"{len(_combinations(light))} combinations of ISO, aperture and exposure time, each at "
                f"{len(levels)} light levels: {_list(light)}."
            ),
        ),
        "shooting_settings_recorded": (
            none_yet,
            f"Exposure time, f-number and ISO are recorded of {named}, read from the files"
            + (f"; typed in where the file lacks them: {_list(typed)}." if typed else "."),
        ),
    }
    return {key: _judge("frames", lacking or "", evidence) for key, (lacking, evidence) in findings.items()}


def _extraction(facts: Facts) -> dict[str, Finding]:
    both = (*_of_role(facts, "light"), *_of_role(facts, "dark"))
    waiting = [frame for frame in both if not frame.extracted]
    lacking = _lack_of_frames(facts, both) or (waiting and f"Without statistics: {_list(waiting)}.") or ""
    named = _list(both)
    drawn = "" if facts.region else "No region was drawn."
    corners = "; ".join(f"{x:g}, {y:g}" for x, y in facts.region)
    steps = {
        "to_tiff": "In place of this step the raw samples were read from the files themselves",
        "imagej_open": "In place of ImageJ the service computed the statistics",
        "first_image": "In place of ImageJ the service computed the statistics",
        "script_filled": "The region was applied to each frame without a script",
        "script_run": "Minimum, mean and maximum of the region were computed per channel",
        "results_saved": "The statistics are kept with each frame, with the hash of its file",
    }
    return {
        "extract_polygon": _judge("region", drawn, f"A region with {len(facts.region)} corners was drawn."),
        "extract_coordinates": _judge("region", drawn, f"Corners (x, y) in pixels: {corners}."),
        **{
            f"extract_{key}": _judge("statistics", lacking, f"{said}: {named}.")
            for key, said in steps.items()
        },
    }


def _dark(facts: Facts) -> dict[str, Finding]:
    light, dark = _of_role(facts, "light"), _of_role(facts, "dark")
    waiting = [frame for frame in dark if not frame.extracted]
    isos = facts.version.isos if facts.version else ()
    undarkened = [f"ISO {iso.iso:g}" for iso in isos if not iso.dark_frames]
    return {
        "dark_frames": _judge(
            "frames",
            _lack_of_frames(facts, light) or _lack_of_dark(light, dark),
            "; ".join(_format_settings(iso, _at(dark, iso)) for iso in _isos(light)) + ".",
        ),
        "dark_extracted": _judge(
            "statistics",
            ("" if dark else "There is no dark frame.")
            or (waiting and f"Without statistics: {_list(waiting)}.")
            or "",
            f"The mean of the region was computed of {_list(dark)}.",
        ),
        "dark_median": _judge(
            "version",
            _lack_of_version(facts)
            or (undarkened and f"From the black level, not from dark frames: {', '.join(undarkened)}.")
            or "",
            (
                "; ".join(
                    f"ISO {iso.iso:g}: {iso.dark_signal_dn:.6g} DN, the median of {iso.dark_frames} frames"
                    for iso in isos
                )
                + "."
            ),
        ),
    }


def _fit(facts: Facts) -> dict[str, Finding]:
    version = facts.version
    isos = version.isos if version else ()
    name = f"Version {version.version}" if version else ""
    points = sum(iso.points for iso in isos)
    lacking = _lack_of_version(facts)
    said = {
        "dark_subtracted": f"{name}: the dark signal of its ISO was subtracted from each of {points} points.",
        "rhs": f"{name}: RHS = t S L / f^2 of {points} points, with L the luminance meter's reading: "
        "computed from the pixel intensity it would need the K it looks for. The fit in ln RHS is reported "
        "beside the others, as semilog.",
        "plot": f"{name}: signal against RHS and ln RHS per ISO are plotted with it.",
        "regression": f"{name}: {'; '.join(map(_format_k, isos))}.",
    }
    return {f"calibration_{key}": _judge("version", lacking, text) for key, text in said.items()}


def _lack_of_frames(facts: Facts, frames: Sequence[FrameFacts]) -> str:
    if facts.unread:
        return f"Not read yet: {name_few('', facts.unread, most=_MOST_NAMES)}."
    return "" if frames else "There are no such frames yet."


def _lack_of_levels(levels: Sequence[str], dark: Sequence[FrameFacts]) -> str:
    if len(levels) < FEWEST_LEVELS:
        return f"Light levels photographed: {len(levels)}; at least {FEWEST_LEVELS} are needed."
    return "" if dark else "No frame was taken with the lamp off."


def _lack_of_settings(light: Sequence[FrameFacts], levels: Sequence[str]) -> str:
    low, high = F_NUMBERS
    for iso in _isos(light):
        here = _at(light, iso)
        if iso not in ISOS:
            return f"ISO {iso:g} is none of 3200, 6400, 12800, 25600: {_list(here)}."
        outside = [frame for frame in here if not low <= frame.f_number <= high]
        if outside:
            return f"The aperture is outside F1.7 to F16: {_list(outside)}."
        if len({frame.f_number for frame in here}) < 2:
            return f"ISO {iso:g} was photographed with a single aperture."
        dim = [level for level in levels if level not in {frame.scene for frame in here}]
        if dim:
            return f"ISO {iso:g} lacks the light level {', '.join(dim)}."
    return ""


def _lack_of_combination(light: Sequence[FrameFacts], levels: Sequence[str]) -> str:
    taken = {(frame.scene, *_settings(frame)) for frame in light}
    for level in levels:
        for iso, f_number, time_s in _combinations(light):
            if (level, iso, f_number, time_s) not in taken:
                return f"{level} lacks a frame at ISO {iso:g}, f/{f_number:g}, {write_exposure(time_s)}."
    return "" if levels else "No light level has been photographed yet."


def _lack_of_dark(light: Sequence[FrameFacts], dark: Sequence[FrameFacts]) -> str:
    for iso in _isos(light):
        apertures = {frame.f_number for frame in _at(dark, iso)}
        if not apertures:
            return f"ISO {iso:g} has no dark frame."
        if len(apertures) < 2:
            return f"The dark frames of ISO {iso:g} have a single aperture."
    return ""


def _lack_of_version(facts: Facts) -> str:
    return "" if facts.version else "The campaign has not been fitted yet."


def _levels(facts: Facts) -> list[str]:
    return sort_naturally({frame.scene for frame in facts.frames if frame.role == "light" and frame.scene})


def _of_role(facts: Facts, role: str) -> list[FrameFacts]:
    return [frame for frame in facts.frames if frame.role == role]


def _at(frames: Iterable[FrameFacts], iso: float) -> list[FrameFacts]:
    return [frame for frame in frames if frame.iso == iso]


def _isos(frames: Iterable[FrameFacts]) -> list[float]:
    return sorted({frame.iso for frame in frames})


def _settings(frame: FrameFacts) -> tuple[float, float, float]:
    return frame.iso, frame.f_number, frame.exposure_time_s


def _combinations(frames: Iterable[FrameFacts]) -> list[tuple[float, float, float]]:
    return sorted({_settings(frame) for frame in frames})


def _format_settings(iso: float, frames: Sequence[FrameFacts]) -> str:
    apertures = ", ".join(f"f/{value:g}" for value in sorted({frame.f_number for frame in frames}))
    times = ", ".join(write_exposure(value) for value in sorted({frame.exposure_time_s for frame in frames}))
    return f"ISO {iso:g}: {apertures} at {times}, {_list(frames)}"


def _format_k(iso: IsoFacts) -> str:
    return (
        f"ISO {iso.iso:g}: K = {iso.luminance_k:.6g} {iso.luminance_k_unit}, standard uncertainty "
        f"{iso.luminance_k_standard_uncertainty:.2g}, {iso.model} model, {iso.points} points"
    )


def _cd(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.6g}" for value in values) + " cd/m2"


def _list(frames: Sequence[FrameFacts]) -> str:
    named = name_few("", [frame.name for frame in frames], most=_MOST_NAMES)
    return f"{len(frames)} frame{'s' * (len(frames) != 1)} ({named})"

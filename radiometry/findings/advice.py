"""What it would take to measure better: one sentence for each thing that stands against a figure."""

from collections.abc import Iterable, Sequence

from radiometry.findings.flags import Flag

_BY_FLAG = {
    Flag.OUTSIDE_EXPOSURE_TIMES: "Calibrate with this exposure time as well, dark frames included, or "
    "photograph with one of the times that were calibrated.",
    Flag.OUTSIDE_F_NUMBERS: "Calibrate with this f-number as well, or photograph with one within the range.",
    Flag.OUTSIDE_SIGNALS: "Choose time and aperture so that the signal falls within the calibrated range, "
    "or extend the calibration by light levels that reach it.",
    Flag.SATURATED: "Take another frame at a quarter of the exposure time: what is saturated is only known "
    "to be brighter.",
    Flag.BELOW_DETECTION: "Expose longer or open the aperture, or average several frames: this signal cannot "
    "be told from dark.",
    Flag.NO_VIGNETTING_CORRECTION: "Calibrate the vignetting of this lens from flat fields and fit K with "
    "that version, or keep what is measured where the calibration's region lay.",
    Flag.ROI_ELSEWHERE: "Turn the camera until the surface lies where the calibration's region lay, or "
    "calibrate with a region there.",
    Flag.OBSERVER_DIFFERS: "For figures after EN 13201 or RP-8, measure from the observer's place with a "
    "luminance meter, and use this one to see the pattern and to compare nights.",
    Flag.RENDERED: "Send the camera's raw file: a tone curve stands between this one's numbers and "
    "the light.",
    Flag.CALIBRATION_NOT_PUBLISHED: "Have the version reviewed and published, or measure with the one "
    "in force.",
    Flag.CALIBRATION_SUPERSEDED: "Measure the frame again: another version is in force now.",
    Flag.CALIBRATION_REVOKED: "Measure the frame again with a version that stands: do not use this figure.",
}
_BY_SOURCE = {
    "fit of K": "Calibrate with more light levels, apertures and readings: the fit of K is the largest "
    "source.",
    "meter calibration": "Use a meter with a smaller calibration uncertainty: it is the largest source here, "
    "and no number of readings or frames reduces it.",
    "dark signal": "Take more dark frames at this ISO value and time: the dark signal is the largest source.",
    "exposure time": "Have the shutter's times measured: the marking of the time is the largest source.",
    "f-number": "Have the apertures measured, or calibrate and measure at one aperture: the marking of the "
    "f-number is the largest source.",
    "ISO setting": "Calibrate at this very ISO setting: it is the largest source.",
    "vignetting": "Take more and brighter flat fields at this f-number: the correction of vignetting is the "
    "largest source.",
    "K": "Take the panel again, before and after the flight, in even light, and state its uncertainty: K is "
    "the largest source.",
    "sunshine readings": "Fly under a steady sky, or take the mean of more readings: the scatter of the "
    "sunshine sensor is the largest source.",
    "sunshine gain": "Take the panel in the light of the flight, so that the sunshine sensor chooses the "
    "same gain: the gain's ratio is the largest source.",
    "pixel noise": "Average several frames or a larger region: the noise of the pixels is the largest "
    "source.",
}


def advise(flags: Iterable[str], *, budget: Sequence[tuple[str, float]]) -> tuple[str, ...]:
    """Give a sentence for each flag that has a remedy, then one for the largest source of uncertainty.

    Takes
      budget : (source, share of the variance) of the region's mean
    """
    raised = set(flags)
    sentences = [sentence for flag, sentence in _BY_FLAG.items() if flag.value in raised]
    largest = max(budget, key=lambda entry: entry[1], default=None)
    if largest is not None and largest[1] > 0.0:
        sentences.append(_BY_SOURCE[largest[0]])
    return tuple(sentences)

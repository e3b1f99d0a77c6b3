"""Suggestions for a better measurement: the remedies of its findings and of its largest uncertainty."""

from collections.abc import Collection, Iterable, Sequence

from radiometry.findings import Finding

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
    "spectral mismatch": "Calibrate under the very light that is measured, or send the measured spectra of "
    "both and the camera's response as tables: the spectral mismatch is the largest source.",
    "flicker": "Expose for a whole number of half periods of the mains, such as 1/50 s of 50 Hz: flicker is "
    "the largest source.",
    "focus distance": "Calibrate at the distance of the measurement: the focus is the largest source.",
    "stray light": "Keep bright lamps out of the frame, and shade the lens: stray light is the largest "
    "source.",
    "K": "Take the panel again, before and after the flight, in even light: K is the largest source.",
    "sunshine readings": "Fly under a steady sky, or take the mean of more readings: the scatter of the "
    "sunshine sensor is the largest source.",
    "drift": "Take the panel nearer to the frames in time, before and after them: K's drift between the "
    "panel visits is the largest source.",
    "sunshine tilt": "Mount the sunshine sensor level, and fly when the sun is high: its tilt is the largest "
    "source.",
    "panel": "Have the panel measured, and take it level and evenly lit: the panel is the largest source.",
    "alignment": "Draw the region where its surroundings are even: what remains of the bands' displacement "
    "is the largest source.",
    "sunshine gain": "Take the panel in the light of the flight, so that the sunshine sensor chooses the "
    "same gain: the gain's ratio is the largest source.",
    "scatter between repeats": "Keep the light and the camera still and average more frames: what the frames "
    "scatter is the largest source.",
    "pixel noise": "Average several frames or a larger region: the noise of the pixels is the largest "
    "source.",
}

_IF_ASSUMED = {
    "spectral mismatch": "State what its correction names as not known, with the campaign of the calibration "
    "or with the night, or calibrate under a lamp of this kind: the spectral mismatch is the largest source.",
    "flicker": "State what its correction names as assumed, with the light of the place, or expose for a "
    "whole number of half periods of the mains, such as 1/50 s of 50 Hz: flicker is the largest source.",
    "focus distance": "State what its correction names as not known: the focus is the largest source.",
    "stray light": "Keep bright lamps out of the frame, and shade the lens, or state the glare that a black "
    "trap shows: stray light is the largest source.",
}
"""In place of the above, where the correction assumes what could have been stated."""


def advise(
    found: Iterable[Finding], *, budget: Sequence[tuple[str, float]], assumed: Collection[str] = ()
) -> tuple[str, ...]:
    """Return the remedy of each finding once, then a sentence for the largest source of uncertainty.

    Parameters
    ----------
    found : iterable of Finding
        The entries of the flags that were raised.
    budget : sequence of (str, float)
        Source and its share of the variance of the region's mean.
    assumed : collection of str, default: ()
        Sources whose correction assumes what could have been stated.

    Returns
    -------
    tuple of str
        One sentence or more each.

    """
    sentences = list(dict.fromkeys(finding.remedy for finding in found))
    largest = max(budget, key=lambda entry: entry[1], default=None)
    if largest is not None and largest[1] > 0.0:
        source = largest[0]
        sentences.append((_IF_ASSUMED if source in assumed else _BY_SOURCE)[source])
    return tuple(sentences)

"""How often each kind of interval holds the truth: `make coverage` prints the table of docs/evidence.md.

The simulators are its own: of `simulation/` a panel's row is taken as a form to fill in. A regime yields
errors, standard and expanded uncertainties, relative where that has a meaning; an oracle knows the variances.
"""

import argparse
import dataclasses
import itertools
import math
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple, TextIO

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import erf, ndtri
from scipy.stats import binomtest

from radiometry.fitting.comparison import Budgeted, compare_measured
from radiometry.fitting.curve import coverage_factor
from radiometry.fitting.evidence import FrameEvidence, Quantity, Region
from radiometry.fitting.sources import SCATTER
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.multispectral import (
    GainMeasurement,
    SunshineCounts,
    SunshineIrradiance,
    SunshineRecord,
)
from radiometry.frame.packing import pack
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import Signal
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.fit import fit_geometry, list_coefficients
from radiometry.geometry.results import Params as GeometryParams
from radiometry.geometry.target import Target, locate_corners_mm
from radiometry.luminance import corrections
from radiometry.luminance import method as luminance
from radiometry.luminance.application import AppliedLuminance, Effect
from radiometry.luminance.fit import compute_risk
from radiometry.luminance.rows import CalibrationConditions, FieldConditions
from radiometry.luminance.rows import Params as LuminanceParams
from radiometry.luminance.surface import CalibratedCamera, Cells, add_up, judge_uniformity
from radiometry.noise import channels, stacks
from radiometry.noise.results import ChannelBlock
from radiometry.noise.results import Params as NoiseParams
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.indices import read_formula
from radiometry.reflectance.measurement import measure_index
from radiometry.reflectance.sun import locate_suns_of
from radiometry.sharpness.edges import JACKKNIFE_DOF
from radiometry.sharpness.fit import extract as extract_sharpness
from radiometry.sharpness.positions import find_resolving_power
from radiometry.sharpness.results import Target as SharpnessTarget
from radiometry.spectral.lamps import LABELS, LampKind, find_modulation, list_spectra
from radiometry.spectral.mismatch import list_responses, read_lamp, read_observer, read_response
from radiometry.vignetting.blocks import Grid, Site
from radiometry.vignetting.channels import fit_channel
from radiometry.vignetting.falloff import Blocks
from tests.radiometry import evidence
from tests.radiometry.coefficients import COEFFICIENT, apply_coefficient
from tests.radiometry.frames import frame_of
from tests.radiometry.geometry.boards import extract as extract_board
from tests.radiometry.geometry.boards import make_header, make_row
from tests.radiometry.reflectance.captures import change_band, take
from tests.radiometry.road.simulated import measure_road

K95 = 1.96


class Drawn(NamedTuple):
    error: float
    u: float
    expanded: float
    oracle: float = math.nan
    risk: float = math.nan  # stated, of an error beyond TOLERANCE


TOLERANCE = 0.04
Random = np.random.Generator
Regime = Callable[[Random], Iterator[Drawn]]
REGIMES: dict[str, tuple[Regime, int]] = {}


def regime(name: str, *, draws: int = 300) -> Callable[[Regime], Regime]:
    def keep(work: Regime) -> Regime:
        REGIMES[name] = (work, draws)
        return work

    return keep


# --- luminance: N - D = K t S L / f^2

APERTURES = (2.8, 4.0, 5.6, 8.0)
SCALE = 0.015  # of the meter, as `evidence.reading` states it


def _draw_campaign(
    random: Random,
    *,
    f: float = 0.003,
    meter: float = 0.005,
    scatter: float = 0.0,
    levels: int = 6,
    current: float = 0.0,
    drift: float | None = None,
    repeats: int = 1,
):
    """K, its frames, the true factor of each aperture and time, the lights, and u(K) of an oracle."""
    time_u = 0.003
    lights = dict(zip("abcdefgh"[:levels], np.geomspace(50.0, 0.5, levels).tolist(), strict=True))
    true_f = {a: 1.0 + f * random.standard_normal() for a in APERTURES}
    true_t: dict[float, float] = {}
    scale = 1.0 + SCALE * random.standard_normal()
    rows, kinds = [], []
    for scene, level in lights.items():
        for n, a in enumerate(APERTURES, 1):
            time_s = float(f"{0.4 * evidence.SPAN * a * a / (evidence.K * 3200.0 * level):.2g}")
            factor = true_t.setdefault(time_s, 1.0 + time_u * random.standard_normal())
            shown = (1.0 + scatter * random.standard_normal()) * factor / true_f[a] ** 2
            shown *= 1.0 + (drift or 0.0) * n / len(APERTURES)
            signal = evidence.K * time_s * 3200.0 * level / a**2 * shown + 0.2 * random.standard_normal()
            signal += current * time_s
            name = f"{scene}-{a}"
            rows.append(evidence.light(scene, a, name=name, time_s=time_s, luminance=level, signal_dn=signal))
            kinds.append((scene, a, time_s))
    for n, time_s in enumerate(sorted(true_t)[-1:] if current else sorted(true_t)):
        dark_dn = evidence.DARK + current * time_s
        rows += [
            evidence.dark(f"dark-{n}-{m}", time_s=time_s, mean_dn=dark_dn + 0.2 * random.standard_normal())
            for m in range(3)
        ]
    readings = [
        evidence.reading(
            scene,
            level * scale * (1.0 + meter * random.standard_normal()) * (1.0 + after * (drift or 0.0)),
        )
        for scene, level in lights.items()
        for after in range(repeats)
    ]
    same = [np.equal.outer(each, each) for each in map(np.array, zip(*kinds, strict=True))]
    variances = (meter**2, 4 * f**2, time_u**2)
    covariance = (
        SCALE**2 + scatter**2 * np.eye(len(kinds)) + sum(v * s for v, s in zip(variances, same, strict=True))
    )
    oracle = 1.0 / math.sqrt(np.linalg.inv(covariance + 1e-12 * np.eye(len(kinds))).sum())
    lamp_u = 0.0 if drift is None else LuminanceParams().lamp_drift_u_rel
    params = LuminanceParams(f_number_u_rel=f, exposure_time_u_rel=time_u, lamp_drift_u_rel=lamp_u)
    fitted = luminance.fit(rows, readings, params).iso_fits[0].coefficient
    return fitted, rows, true_f, true_t, lights, oracle


def _k(*, drifts: tuple[float, float] | None = None, judged: bool = False, **campaign) -> Regime:
    def work(random: Random) -> Iterator[Drawn]:
        drift = None if drifts is None else random.uniform(*drifts)
        k, *_, oracle = _draw_campaign(random, drift=drift, **campaign)
        u = k.luminance_k_standard_uncertainty / evidence.K
        risk = compute_risk(u_rel=u, dof=k.effective_dof or math.inf, tolerance_rel=TOLERANCE)
        yield Drawn(
            k.luminance_k / evidence.K - 1.0,
            u,
            k.expanded_uncertainty / evidence.K,
            oracle if drifts is None else math.nan,
            risk if judged else math.nan,
        )

    return work


regime("K, apertures off by 1.5 %")(_k(f=0.015))
regime("K, readings repeat to 3 %", draws=1000)(_k(meter=0.03))
regime("K, frames scatter by 1 %")(_k(scatter=0.01))
for percent in (1, 3):
    named = f"K beyond 4 % by the stated risk, four levels, readings repeat to {percent} %"
    regime(named, draws=600)(_k(meter=percent / 100.0, levels=4, judged=True))
regime("K, three levels, readings repeat to 1 %", draws=1000)(_k(meter=0.01, levels=3))
for current in (2.0, 20.0):
    regime(f"K, darks of one time, {current:g} DN/s")(_k(current=current))

DRIFT = 0.02  # of a lamp during a scene that is not timed: before the first frame 0
regime("K, lamps that change by up to 2 % in a scene, read before")(_k(drifts=(-DRIFT, DRIFT)))
regime("K, lamps that brighten by 2 % in each scene, read before")(_k(drifts=(DRIFT, DRIFT)))
regime("K, lamps that brighten by 2 % in each scene, read before and after")(
    _k(drifts=(DRIFT, DRIFT), repeats=2)
)


def _draw_night(random: Random, scatter: float) -> Iterator[tuple[float, AppliedLuminance, float]]:
    """Yield later frames of a camera at settings of its calibration: the truth, what is found, and its k."""
    k, rows, true_f, true_t, lights, _ = _draw_campaign(random, f=0.015, scatter=scatter)
    row = rows[random.integers(len(lights) * len(APERTURES))]
    camera = CalibratedCamera(exposure=row.exposure, coefficient=k, lens=None, corrections=())
    time_s, a = row.exposure.exposure_time_s, row.exposure.f_number
    while True:
        shown = true_t[time_s] / true_f[a] ** 2 * (1.0 + scatter * random.standard_normal())
        signal = (
            evidence.K * time_s * 3200.0 * lights[row.scene] / a**2 * shown + 0.2 * random.standard_normal()
        )
        statistics = (evidence.statistics(evidence.DARK + signal),)
        applied = apply_coefficient(statistics, exposure=row.exposure, coefficients=[k])
        yield lights[row.scene], applied, coverage_factor(camera.find_dof(applied))


def _field(scatter: float) -> Regime:
    def work(random: Random) -> Iterator[Drawn]:
        truth, applied, factor = next(_draw_night(random, scatter))
        found = applied.luminance_cd_m2
        u = found.standard_uncertainty / found.value
        yield Drawn(found.value / truth - 1.0, u, factor * u)

    return work


def _nights(scatter: float) -> Regime:
    """The difference of two frames of a light that did not change."""

    def work(random: Random) -> Iterator[Drawn]:
        both = [applied for _, applied, _ in itertools.islice(_draw_night(random, scatter), 2)]
        shared = {each.source for each in both[0].effects if each.shared} - {SCATTER}
        old, new = (
            Budgeted(
                value=each.luminance_cd_m2.value,
                unit="cd/m2",
                effects={e.source: add_up(each.effects, source=e.source) for e in each.effects},
            )
            for each in both
        )
        change = compare_measured(old, new, common=shared).change
        u = change.standard_uncertainty / 100.0
        yield Drawn(change.value / 100.0, u, K95 * u)

    return work


for percent in (0.3, 1.0, 3.0):
    regime(f"L, frames scatter by {percent:g} %", draws=1000)(_field(percent / 100.0))
    regime(f"two nights with nothing changed, frames scatter by {percent:g} %")(_nights(percent / 100.0))


def _mean(count: int) -> Regime:
    """Lamps of any depth on 50 Hz at 1/60 s, whose phase nobody knows."""
    time_s = 1 / 60
    half = abs(math.sin(100 * math.pi * time_s)) / (100 * math.pi * time_s)
    settings = Settings(exposure_time_s=time_s, f_number=4.0, iso=3200.0)
    flicker, _ = corrections.correct_flicker(FieldConditions(mains_frequency_hz=50.0), settings, frames=count)
    camera = CalibratedCamera(
        exposure=Exposure(exposure_time_s=time_s, f_number=4.0, iso=3200.0),
        coefficient=dataclasses.replace(COEFFICIENT, dark_signal_dn=0.0, frame_scatter_rel=None),
        lens=None,
        corrections=(flicker,),
    )

    def work(random: Random) -> Iterator[Drawn]:
        depth = random.uniform() * half
        shown = 300 * (
            1 + depth * np.sin(random.uniform(0, 2 * np.pi, count))
        ) + 0.5 * random.standard_normal(count)
        signals = [
            Signal(
                value_dn=each,
                standard_uncertainty_dn=0.5,
                saturated_share=0.0,
                black_level_dn=0.0,
                white_level_dn=4095.0,
            )
            for each in shown.tolist()
        ]
        mean = camera.average(signals)
        u = math.hypot(mean.frames.rel, mean.corrections[0].u_rel, 0.5 / 300 / math.sqrt(count))
        factor = coverage_factor(mean.frames.dof)
        yield Drawn(shown.mean() / 300 - 1.0, u, factor * u, depth / math.sqrt(2 * count))

    return work


for count in (2, 3, 4):
    regime(f"mean of {count} frames under flicker", draws=20000)(_mean(count))


def _flicker(kind: LampKind, time_s: float) -> Regime:
    """One frame of a lamp of a kind on 50 Hz."""
    low, high = find_modulation(kind, None)
    half = abs(math.sin(100 * math.pi * time_s)) / (100 * math.pi * time_s)
    settings = Settings(exposure_time_s=time_s, f_number=4.0, iso=3200.0)
    stated = FieldConditions(mains_frequency_hz=50.0, lamp_kind=kind)
    u = corrections.correct_flicker(stated, settings, frames=1)[0].u_rel
    phases = np.sin(np.linspace(0.0, 2 * math.pi, 2000, endpoint=False))

    def work(random: Random) -> Iterator[Drawn]:
        depth = half * random.uniform(low, high)
        shown = 1.0 + depth * math.sin(random.uniform(0.0, 2 * math.pi))
        # of one that knows the depth: 1 / shown is skewed
        errors = np.abs(1.0 / (1.0 + depth * phases) - 1.0)
        oracle = max(math.sqrt(np.mean(errors**2)), float(np.quantile(errors, 0.95)) / K95)
        yield Drawn(1.0 / shown - 1.0, u, K95 * u, oracle)

    return work


for kind, each in (("led", 250), ("led_ripple", 60), ("sodium", 60), ("sodium", 250)):
    regime(f"L, one frame under `{kind}` on 50 Hz, 1/{each} s", draws=2000)(_flicker(kind, 1 / each))


@regime("L at 2 m, K at 1 m to 1.7 %, glare of 10 % of L", draws=2000)
def _focus_and_glare(random: Random) -> Iterator[Drawn]:
    """A pupil magnified by 0.7 to 1.5; glare at the place within a half of that of the trap."""
    pupil, place, mean = random.uniform(0.7, 1.5), random.uniform(0.5, 1.5), 5.0
    lost = [(1 + 0.015 / (d - 0.015) / pupil) ** 2 for d in (1.0, 2.0)]
    seen = (1 + 0.017 * random.standard_normal()) * lost[0] / lost[1] + place * 0.02 * mean
    known = CalibrationConditions(focus_distance_m=1.0, focal_length_mm=15.0)
    focus = corrections.correct_focus(
        FieldConditions(distance_m=2.0), dataclasses.replace(COEFFICIENT, conditions=known)
    )
    stray, _ = corrections.correct_stray_light(FieldConditions(glare_share=0.02), mean)
    shown = AppliedLuminance(
        luminance_cd_m2=Quantity(seen, 0.017 * seen, "cd/m2"),
        effects=(Effect(source="fit of K", shared=True, effect_cd_m2=0.017 * seen),),
        flags=(),
        signal_dn=300.0,
        adjusted_signal_dn=300.0,
        rhs=10.0,
    )
    found = corrections.apply_corrections(shown, (focus, stray)).luminance_cd_m2
    yield Drawn(found.value - 1.0, found.standard_uncertainty, K95 * found.standard_uncertainty)


def _spectrum(*, camera_known: bool) -> Regime:
    """A lamp of the library of a known kind, after a calibration under A; the region shows its raw colour."""

    def work(random: Random) -> Iterator[Drawn]:
        camera, kind = str(random.choice(list_responses())), str(random.choice(list(LABELS)))
        lamp = read_lamp(str(random.choice(list_spectra(kind, None))))
        # one body differs from another by 2 nm, a lamp from the library's by 15 % of ln F
        response = read_response(camera)
        response = response + 0.4 * random.standard_normal() * np.gradient(response, axis=0)
        both = [spectrum @ response for spectrum in (read_lamp("A"), lamp)]
        shown = both[1][1] / (lamp @ read_observer()) / (both[0][1] / (read_lamp("A") @ read_observer()))
        shown **= 1 + 0.15 * random.standard_normal()
        colours = [(red / green, blue / green) for red, green, blue in both]
        known = CalibrationConditions(
            lamp="A", camera_response=camera if camera_known else None, colour=colours[0]
        )
        line, _ = corrections.correct_spectrum(
            FieldConditions(lamp_kind=kind), dataclasses.replace(COEFFICIENT, conditions=known), colours[1]
        )
        yield Drawn(shown * line.factor - 1.0, line.u_rel, K95 * line.u_rel)

    return work


regime("L of a lamp of known kind, camera known", draws=1000)(_spectrum(camera_known=True))
regime("L of a lamp of known kind, camera unknown", draws=1000)(_spectrum(camera_known=False))


ALONG, ACROSS = np.meshgrid((np.arange(10) + 0.5) / 10, (np.arange(6) + 0.5) / 6)
POOLS = 1.0 + 0.45 * np.cos(2 * np.pi * ALONG) * (1.1 - 0.3 * ACROSS)
EQUAL = np.ones_like(POOLS)
DARKER = np.where(np.arange(60).reshape(6, 10) == 24, 0.85, 1.0)


def _uniformity(noise: float, *, lengthwise: bool = False, light: np.ndarray = POOLS) -> Regime:
    none = np.zeros((0, *light.shape))

    def work(random: Random) -> Iterator[Drawn]:
        seen = light * (1 + noise * random.standard_normal(light.shape))
        cells = Cells(values_cd_m2=seen, noise_cd_m2=noise * seen, shared_cd_m2=none, local_cd_m2=none)
        surface = judge_uniformity(cells)
        truths = light.min(axis=1) / light.max(axis=1) if lengthwise else [light.min() / light.mean()]
        for found, truth in zip(surface.u_l if lengthwise else [surface.u_o], truths, strict=True):
            u = found.standard_uncertainty / truth
            yield Drawn(found.value / truth - 1.0, u, K95 * u)

    return work


for noise in (0.05, 0.1):
    regime(f"U_o, cells to {100 * noise:g} %", draws=2000)(_uniformity(noise))
    regime(f"U_l, cells to {100 * noise:g} %", draws=1000)(_uniformity(noise, lengthwise=True))
regime("U_o, equal cells to 5 %", draws=2000)(_uniformity(0.05, light=EQUAL))
regime("U_o, one of equal cells 15 % darker, to 5 %", draws=2000)(_uniformity(0.05, light=DARKER))


# --- reflectance: a panel that leans by 2 degrees, a light sensor on a mount, a sky that is partly diffuse

SHOT = take(np.random.default_rng(1), {"green": 0.18})[0]
PANEL_READING = reflectance.Reading(panel="P", band="green", reflectance=0.69, standard_uncertainty=0.002)


def _turn(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """Return the direction of what points up before it is turned; x to the north, z down."""
    (cy, cp, cr), (sy, sp, sr) = np.cos([yaw, pitch, roll]), np.sin([yaw, pitch, roll])
    return -np.array([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])


def _pass(cosine: float) -> float:
    """What a diffuser of refractive index 1.38 lets in, by Fresnel."""
    inside = math.sqrt(1 - (1 - cosine**2) / 1.38**2)
    across, along = (
        (cosine - 1.38 * inside) / (cosine + 1.38 * inside),
        (inside - 1.38 * cosine) / (inside + 1.38 * cosine),
    )
    return 1 - (across**2 + along**2) / 2


def _hang(random: Random, mount: np.ndarray, sun: np.ndarray) -> tuple[float, dict[str, float]]:
    """What a light sensor that leans by some 4 degrees takes of the sun, and the attitude it states."""
    yaw, tilt = random.uniform(0, 2 * math.pi), random.normal(0.0, math.radians(4.0), 2)
    own = random.normal(0.0, math.radians(2.0) * math.sqrt(0.5), 2)
    cosine = max(0.0, float(_turn(yaw, *(tilt + mount + own)) @ sun))
    angles = np.degrees([yaw, *tilt]).tolist()
    stated = dict(zip(("yaw_deg", "pitch_deg", "roll_deg"), angles, strict=True))
    return cosine * _pass(cosine) / _pass(1.0), stated


def _count(random: Random, light: float, noise: float, attitude: dict[str, float]) -> SunshineCounts:
    """Ten readings of a Sequoia at gain 1 or 2, whose table of whole counts stands for its true gains."""
    index, table = random.integers(1, 3), np.array([330.0, 3990.0]) + random.uniform(-0.5, 0.5, 2)
    seen = 430.0 * light * table[index - 1] / table[0] * (1 + noise * random.standard_normal(10))
    return SunshineCounts(
        record_bytes=28,
        cut_short=False,
        records=tuple(
            SunshineRecord(
                time_us=n * 200_000, ch0=round(each), ch1=round(each / 4), gain_index=int(index),
                integration_time_s=0.1, **attitude,
            )
            for n, each in enumerate(seen.tolist())
        ),
        gains=tuple(
            GainMeasurement(gain_index=n, integration_time_s=0.6, ch0=round(each), ch1=round(each / 4))
            for n, each in enumerate(table.tolist(), 1)
        ),
    )  # fmt: skip


def _find_sun(latitude_deg: float):
    """The header of a frame at an equinox's noon, the sun's height [rad], and the direction towards it."""
    at = {"taken_at": "2018-03-20T12:07:00", "longitude_deg": 0.0, "latitude_deg": latitude_deg}
    header = dataclasses.replace(SHOT.header, **at)
    (position,) = locate_suns_of(header)
    height, azimuth = math.radians(position.elevation_deg), math.radians(position.azimuth_deg)
    sun = np.array(
        [math.cos(azimuth) * math.cos(height), math.sin(azimuth) * math.cos(height), -math.sin(height)]
    )
    return header, height, sun


def _reflectance(noise: float, latitude_deg: float, shots: int, *, counted: bool = False) -> Regime:
    """R = 0.3 of a later frame, one light reading at each shot of the panel and at the frame, or counts."""
    header, height, sun = _find_sun(latitude_deg)

    def work(random: Random) -> Iterator[Drawn]:
        diffuse = float(np.clip(random.normal(1 / 6, 0.1), 0.0, 0.6))
        mount = random.normal(0.0, math.radians(2.0) * math.sqrt(0.5), 2)

        def see(row):
            direct, stated = _hang(random, mount, sun)
            light = (1 - diffuse) * direct / math.sin(height) + diffuse
            if counted:
                return change_band([row], counts=_count(random, light, noise, stated))[0]
            sensor = SunshineIrradiance(
                irradiance_w_m2_nm=43000.0 * light * (1 + noise * random.standard_normal()),
                quantity="spectral", unit_origin="tag", **stated,
            )  # fmt: skip
            return change_band([row], counts=None, irradiance=sensor)[0]

        panel = (
            _turn(random.uniform(0, 2 * math.pi), *random.normal(0.0, math.radians(2.0), 2))
            @ sun
            / math.sin(height)
        )
        true = 0.69 + 0.002 * random.standard_normal()
        signals = (true * 43000.0 * panel / 1300.0, 0.3 * 43000.0 / 1300.0)
        features = [dataclasses.replace(SHOT.features, i_sq=each, gradient_rel=0.0) for each in signals]
        row = dataclasses.replace(SHOT, header=header, features=features[0])
        rows = [see(dataclasses.replace(row, frame=f"panel-{n}")) for n in range(shots)]
        fit = reflectance.fit(rows, [PANEL_READING], reflectance.Params(drift_half_hour_rel=0.0))
        frame = see(dataclasses.replace(SHOT, role="field", header=header, features=features[1]))
        k = fit.band_fits[0].coefficient
        found = reflectance.apply_features(features[1], header=frame.header, coefficients=[k])
        value, u = found.reflectance.value, found.reflectance.standard_uncertainty
        factor, _ = found.doubt.expand(u**2)
        yield Drawn(value / 0.3 - 1.0, u / value, factor * u / value)

    return work


for noise, latitude_deg, shots in (
    *((0.03, 20.0, 1), (0.05, 20.0, 1), (0.03, 50.0, 1), (0.05, 50.0, 1)),
    *((0.01, 20.0, 10), (0.03, 20.0, 10), (0.05, 20.0, 10)),
):
    named = f"R, {shots} light reading{'s' * (shots > 1)} to {100 * noise:g} %, sun at {latitude_deg:g}°"
    regime(named, draws=4000 if shots > 1 else 1000)(_reflectance(noise, latitude_deg, shots))
for noise in (0.002, 0.02):
    named = f"R, a Sequoia's ten counts to {100 * noise:g} %, sun at 20°"
    regime(named, draws=4000)(_reflectance(noise, 20.0, 1, counted=True))


# near infrared and red: wavelength [nm], reflectance of a canopy and of a panel
INDEXED = {"nir": (840.0, 0.45, 0.61), "red": (668.0, 0.05, 0.68)}


def _ndvi(noise: float) -> Regime:
    """NDVI of one capture by one of a panel that is levelled by eye; clear air, and haze of any amount."""
    header, height, sun = _find_sun(40.0)
    readings = [
        dataclasses.replace(PANEL_READING, band=band, reflectance=panel, standard_uncertainty=0.01 * panel)
        for band, (_, _, panel) in INDEXED.items()
    ]
    truth = (0.45 - 0.05) / (0.45 + 0.05)

    def work(random: Random) -> Iterator[Drawn]:
        haze = max(0.0, random.normal(0.15, 0.144))
        mount = random.normal(0.0, math.radians(2.0) * math.sqrt(0.5), 2)

        def see(role: str, facing: np.ndarray):
            """One capture: the bands share attitude, mount and haze, and each has its own reading."""
            (direct, stated), rows = _hang(random, mount, sun), []
            for band, (wavelength_nm, canopy, panel) in INDEXED.items():
                r = wavelength_nm / 650.0
                odds = 0.05 * r**-4 + haze * r**-1.3
                diffuse = odds / (1 + odds)
                light = (1 - diffuse) * direct / math.sin(height) + diffuse
                lit = (1 - diffuse) * float(facing @ sun) / math.sin(height) + diffuse
                true = panel * (1 + 0.01 * random.standard_normal()) if role == "panel" else canopy
                sensor = SunshineIrradiance(
                    irradiance_w_m2_nm=light * (1 + noise * random.standard_normal()),
                    quantity="spectral", unit_origin="tag", **stated,
                )  # fmt: skip
                features = dataclasses.replace(SHOT.features, band=band, i_sq=true * lit, gradient_rel=0.0)
                row = dataclasses.replace(
                    SHOT, frame=f"{role}-{band}", role=role, header=header, features=features
                )
                told = {"band": band, "wavelength_nm": wavelength_nm, "counts": None, "irradiance": sensor}
                rows += change_band([row], **told)
            return rows

        leant = _turn(random.uniform(0, 2 * math.pi), *random.normal(0.0, math.radians(2.0), 2))
        fit = reflectance.fit(see("panel", leant), readings, reflectance.Params(drift_half_hour_rel=0.0))
        known = [each.coefficient for each in fit.band_fits]
        bands = [
            reflectance.apply_features(row.features, header=row.header, coefficients=known)
            for row in see("field", np.array([0.0, 0.0, -1.0]))
        ]
        found = measure_index(read_formula("ndvi"), bands, coefficients=known)
        value = found.value
        yield Drawn(value.value - truth, value.standard_uncertainty, found.expanded_uncertainty or math.nan)

    return work


for noise in (0.01, 0.025, 0.05):
    regime(f"NDVI, one light reading to {100 * noise:g} %, sun at 40°", draws=1000)(_ndvi(noise))


# --- roads: 8 control points, patches of 5 and 10 %, b1 within 0.3


def _road(at: int) -> Regime:
    def work(random: Random) -> Iterator[Drawn]:
        error, half, *_ = measure_road(int(random.integers(2**31)))[at]
        yield Drawn(error, half / K95, half)

    return work


for at, figure in enumerate(("E_av", "U_0")):
    regime(f"{figure} of a road, 8 control points", draws=200)(_road(at))


# --- optics


def _falloff(light: Callable[[np.ndarray], np.ndarray]) -> Regime:
    """V at the corner from one flat with a plane of 1 % and a centre that is 3 % of the half diagonal off."""
    height, width = 640, 960
    reach = math.hypot(height, width) / 2
    y, x = np.arange(height)[:, None], np.arange(width)[None]

    def work(random: Random) -> Iterator[Drawn]:
        centre = np.array([(height - 1) / 2, (width - 1) / 2]) + 0.03 * reach * random.standard_normal(2)
        slope = 0.01 * random.standard_normal(2)
        plane = 1 + (slope[0] * (y - height / 2) + slope[1] * (x - width / 2)) / reach
        shown = light(((y - centre[0]) ** 2 + (x - centre[1]) ** 2) / reach**2) * plane
        grid = Grid.over(height, width)
        rows, cols = grid.axes(Site(row0=0, col0=0, step=1))
        blocks = np.add.reduceat(np.add.reduceat(shown, rows.starts, 0), cols.starts, 1)
        blocks /= np.outer(rows.counts, cols.counts)
        noise = 4e-4 * np.sqrt(blocks)
        flat = Blocks(
            grid=grid,
            rows=rows,
            cols=cols,
            light=blocks + noise * random.standard_normal(blocks.shape),
            standard_error=noise,
        )
        found = fit_channel([flat], f_number=2.0, channel="grey").fit.coefficient
        corners = [(row, col) for row in (-0.5, height - 0.5) for col in (-0.5, width - 0.5)]
        truth = light(np.array(max(math.dist(each, centre) for each in corners) ** 2 / reach**2))
        u = found.corner_falloff_standard_uncertainty
        yield Drawn(float(1.0 - found.corner_falloff - truth), u, K95 * u)

    return work


def _cos4(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda s: (1 + s * math.tan(math.radians(degrees)) ** 2) ** -2


for degrees in (25, 35, 42):
    regime(f"V at the corner, cos⁴ to {degrees}°", draws=100)(_falloff(_cos4(degrees)))
regime("V at the corner, cos⁴ to 30° with a rim", draws=100)(
    _falloff(lambda s: _cos4(30)(s) * (1 - 0.25 / (1 + np.exp((0.8 - np.sqrt(s)) / 0.12))))
)


def _extract(shown: np.ndarray, target: SharpnessTarget):
    """What is found in a square picture but for its rim."""
    size, end = len(shown), len(shown) - 2
    camera = CameraModel(height_px=size, width_px=size, fx_px=1.0, fy_px=1.0, cx_px=0.0, cy_px=0.0)
    whole = Region(name="", polygon=Polygon.from_points([(2, 2), (end, 2), (end, end), (2, end)]))
    frame, header = frame_of(shown, cfa="grey"), make_header(camera)
    return extract_sharpness(frame, [whole], header=header, exposure=None, target=target).features.regions[0]


@regime("MTF50, blur 0.8 px, noise 1 %", draws=100)
def _edge(random: Random) -> Iterator[Drawn]:
    angle, sigma, size = math.radians(random.uniform(4.0, 9.0)), 0.8, 80
    row, col = np.mgrid[:size, :size] - (size - 1) / 2
    distance = (col + random.uniform(-1, 1)) * math.cos(angle) + row * math.sin(angle)
    shown = (
        500.0
        + 1000.0 * (1 + erf(distance / (sigma * math.sqrt(2))))
        + 20.0 * random.standard_normal((size, size))
    )
    found = _extract(shown, SharpnessTarget()).edges[0].mtf50
    truth = math.sqrt(math.log(2.0) / 2.0) / (math.pi * sigma)
    u = found.standard_uncertainty / truth
    yield Drawn(found.value / truth - 1.0, u, coverage_factor(JACKKNIFE_DOF) * u)


@regime("a star's limiting resolution, blur 0.8 px, noise 1 %", draws=300)
def _star(random: Random) -> Iterator[Drawn]:
    """A star of 36 sinusoidal cycles, each radius with the transfer of its frequency."""
    sigma, cycles, size = 0.8, 36, 190
    row, col = np.mgrid[:size, :size] - (size - 1) / 2 - random.uniform(-3, 3, 2)[:, None, None]

    def respond(frequency):
        return np.exp(-2 * (np.pi * sigma * frequency) ** 2)

    contrast = 0.8 * respond(cycles / (2 * np.pi * np.maximum(np.hypot(row, col), 1e-9)))
    shown = 1000.0 * (1 + contrast * np.cos(cycles * np.arctan2(row, col)))
    shown += 10.0 * random.standard_normal(shown.shape)
    star = _extract(shown, SharpnessTarget(kind="siemens_star", cycles=cycles)).stars[0]
    found = find_resolving_power(star.frequency, star.whole, contrast=0.1)
    reference = respond(np.array(star.frequency[:6])).mean()
    truth = math.sqrt(-math.log(0.1 * reference) / 2.0) / (math.pi * sigma)
    u = found.standard_uncertainty / truth
    yield Drawn(found.value / truth - 1.0, u, K95 * u)


BOARD = Target(kind="checkerboard", columns=9, rows=6, square_size_mm=25.0)
TRUE = {"fx_px": 520.0, "cx_px": 332.0, "cy_px": 229.0, "k1": -0.2}


def _hold_board(random: Random, far: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The rotation of a board, and the place of its middle before the lens [mm]."""
    turn = random.uniform(-0.6, 0.6, 3)
    cosine, sine = np.cos(turn), np.sin(turn)
    about_x = np.array([[1, 0, 0], [0, cosine[0], -sine[0]], [0, sine[0], cosine[0]]])
    about_y = np.array([[cosine[1], 0, sine[1]], [0, 1, 0], [-sine[1], 0, cosine[1]]])
    about_z = np.array([[cosine[2], -sine[2], 0], [sine[2], cosine[2], 0], [0, 0, 1]])
    return about_z @ about_y @ about_x, np.array([*random.uniform(-60, 60, 2), random.uniform(*far)])


def _find_error(rows: list[FrameEvidence], name: str, truth: float) -> Drawn:
    found = next(
        each for each in list_coefficients(fit_geometry(rows, GeometryParams())) if each.name == name
    )
    u = found.standard_uncertainty
    return Drawn(found.value - truth, u, coverage_factor(found.effective_dof or math.inf) * u)


def _geometry(name: str) -> Regime:
    """Twelve views of a board whose corners are good to 0.1 px, seen through f (1 + k1 r^2)."""
    board = locate_corners_mm(BOARD, np.arange(BOARD.corners))
    camera = CameraModel(height_px=480, width_px=640, fx_px=520.0, fy_px=520.0, cx_px=332.0, cy_px=229.0)

    def work(random: Random) -> Iterator[Drawn]:
        rows = []
        for view in range(12):
            turn, place = _hold_board(random, (330, 450))
            middle = np.column_stack([board - board.mean(axis=0), np.zeros(len(board))])[:, :3]
            at = middle @ turn.T + place
            x, y = at[:, 0] / at[:, 2], at[:, 1] / at[:, 2]
            bend = 1 + TRUE["k1"] * (x * x + y * y)
            seen = np.column_stack([229.0 + 520.0 * y * bend, 332.0 + 520.0 * x * bend])
            seen += 0.1 * random.standard_normal(seen.shape)
            rows.append(make_row(f"view-{view}", camera, BOARD, np.arange(len(board)), seen))
        yield _find_error(rows, name, TRUE[name])

    return work


def _picture(name: str) -> Regime:
    """Ten pictures of 320 x 240 px: squares of 13 to 22 px, a blur of 0.7 px, noise of 1 %, no distortion."""
    truth = TRUE[name] / 2.0
    y, x = (np.mgrid[: 240 * 3, : 320 * 3] + 0.5) / 3 - 0.5
    rays = np.stack([(x - 166.0) / 260.0, (y - 114.5) / 260.0, np.ones_like(x)], axis=-1)

    def work(random: Random) -> Iterator[Drawn]:
        rows = []
        for view in range(10):
            turn, place = _hold_board(random, (330, 450))
            on_board = rays @ np.linalg.inv(np.column_stack([turn[:, :2], place])).T
            columns, lines = (
                on_board[..., n] / on_board[..., 2] / 25.0 + half for n, half in ((0, 5), (1, 3.5))
            )
            inside = (columns > 0) & (columns < 10) & (lines > 0) & (lines < 7)
            dark = inside & ((np.floor(columns) + np.floor(lines)) % 2 == 0)
            light = np.where(dark, 400.0, 3000.0).reshape(240, 3, 320, 3).mean(axis=(1, 3))
            shown = gaussian_filter(light, 0.7) + 30.0 * random.standard_normal(light.shape)
            found = extract_board(frame_of(shown, cfa="grey", black=0.0), target=BOARD, bits=12)
            if not found.features.not_found:
                camera = CameraModel(height_px=240, width_px=320, fx_px=1.0, fy_px=1.0, cx_px=0.0, cy_px=0.0)
                places = np.array(found.features.fitted_px)
                row = make_row(f"view-{view}", camera, BOARD, np.array(found.features.indices), places)
                rows.append(dataclasses.replace(row, features=found.features))
        yield _find_error(rows, name, truth)

    return work


for name in ("fx_px", "cx_px"):
    named = f"{name.removesuffix('_px')} / 2, corners found in pictures of squares of 13 to 22 px"
    regime(named, draws=100)(_picture(name))
for name in TRUE:
    regime(f"{name.removesuffix('_px')}, corners to 0.1 px", draws=100)(_geometry(name))


# --- noise: a sensor of 96 x 96 pixels, 0.5 DN/e-, read noise 4 e-

SIDE, GAIN, WHITE = 96, 0.5, 16383.0


def _expose(random: Random, electrons: float, *, pattern, prnu, count: int) -> list[np.ndarray]:
    found = []
    for _ in range(count):
        light = random.poisson(electrons * prnu) if electrons else 0.0
        shown = light + pattern + random.normal(0.0, 4.0, (SIDE, SIDE))
        found.append(np.clip(np.rint(256.0 + GAIN * shown), 0, WHITE).astype(np.uint16))
    return found


def _stack(frames: list[np.ndarray], role: str, time_s: float):
    setting = stacks.Setting(role, "", 100.0, 0.0 if role == "dark" else 4.0, time_s, "grey", (0, 0, SIDE))
    blocks = [
        (
            f"{role}-{time_s}-{n}",
            ChannelBlock(
                channel="grey", row0=0, col0=0, step=1, samples_dn=pack(each, dtype="<u2"),
                clipped_share=float((each >= WHITE).mean()), zero_share=float((each == 0).mean()),
                black_level_dn=256.0, white_level_dn=WHITE,
            ),
        )
        for n, each in enumerate(frames)
    ]  # fmt: skip
    return stacks._measure(setting, blocks)


def _dsnu(deviation_e: float, count: int) -> Regime:
    def work(random: Random) -> Iterator[Drawn]:
        pattern = random.normal(0.0, deviation_e, (SIDE, SIDE))
        dark = _stack(_expose(random, 0.0, pattern=pattern, prnu=1.0, count=count), "dark", 0.01)
        found = channels.find_dsnu([dark])[0]
        truth = deviation_e * GAIN
        u = found.standard_uncertainty / truth
        yield Drawn(found.value / truth - 1.0, u, K95 * u)

    return work


for deviation_e, count in ((3.0, 2), (3.0, 16), (1.0, 16)):
    regime(f"DSNU of {deviation_e:g} e⁻ beside 4 e⁻, {count} frames")(_dsnu(deviation_e, count))


FULL_WELL, PRNU, CURRENT = 24_000.0, 0.01, 40.0  # e-; e-/s


def _fill(electrons: np.ndarray, softness: float, *, round_end: bool = False) -> np.ndarray:
    """What a well holds of the electrons: it ends at FULL_WELL, within ``softness`` of it."""
    if round_end:  # a parabola between the line and the end, as much below the end's corner
        half = 4 * math.log(2.0) * softness
        inside = np.minimum(electrons, FULL_WELL + half)
        return inside - np.maximum(inside - FULL_WELL + half, 0.0) ** 2 / (4 * half)
    return FULL_WELL - softness * np.logaddexp(0.0, (FULL_WELL - electrons) / softness)


def _find_true_saturation(fill: Callable[[np.ndarray], np.ndarray]) -> float:
    """The mean signal of the greatest variance from frame to frame [DN]."""
    normal = ndtri((np.arange(200) + 0.5) / 200)
    pixels = 1.0 + PRNU * normal[::20, None]
    found = []
    for electrons in np.linspace(0.4, 1.1, 701) * FULL_WELL:
        seen = fill(electrons * pixels + np.sqrt(electrons * pixels) * normal)
        found.append((float(seen.var(axis=1).mean()), float(seen.mean())))
    return GAIN * max(found)[1]


def _sensor(figure: str, truth: float = math.nan) -> Regime:
    """Two frames of each of 12 levels and darks of three times; the well ends below white.

    Where its end is sought, it is as soft as any from 0.1 to 15 % of it, in one of two forms.
    """

    def expose(random: Random, role: str, time_s: float, prnu, rate: float, fill):
        shown = [
            np.rint(
                256.0
                + GAIN
                * (
                    fill(random.poisson(rate * time_s * prnu + CURRENT * time_s).astype(float))
                    + random.normal(0.0, 4.0, (SIDE, SIDE))
                )
            ).astype(np.uint16)
            for _ in range(2)
        ]
        return _stack(shown, role, time_s)

    def work(random: Random) -> Iterator[Drawn]:
        fill, true = partial(_fill, softness=1.0), truth
        if math.isnan(truth):
            softness = FULL_WELL * math.exp(random.uniform(math.log(1e-3), math.log(0.15)))
            fill = partial(_fill, softness=softness, round_end=bool(random.integers(2)))
            true = _find_true_saturation(fill)
        prnu = 1.0 + PRNU * random.standard_normal((SIDE, SIDE))
        times = np.linspace(0.1, 1.2, 12) * random.uniform(0.96, 1.04)
        made = [expose(random, "light", time_s, prnu, FULL_WELL, fill) for time_s in times.tolist()]
        made += [expose(random, "dark", time_s, prnu, 0.0, fill) for time_s in (0.01, 0.5, 2.0)]
        fit = channels.fit_channel(made, NoiseParams())
        assert fit is not None
        found = next(
            getattr(part, figure)
            for part in (fit.fit, fit.fit.transfer, fit.fit.dark_current)
            if hasattr(part, figure)
        )
        u = found.standard_uncertainty / true
        k = coverage_factor(fit.fit.effective_dof.get(figure, math.inf))
        yield Drawn(found.value / true - 1.0, u, k * u)

    return work


for figure, truth in (
    ("system_gain_dn_per_e", GAIN),
    ("read_noise_dn", GAIN * math.sqrt(4.0**2 + 0.01 * CURRENT)),
    ("prnu_rel", PRNU),
    ("dark_current_e_per_s", CURRENT),
):
    regime(f"{figure}, two frames a level", draws=200)(_sensor(figure, truth))
regime("saturation of a well that ends in a way that is not known", draws=200)(_sensor("saturation_dn"))


# --- the table


def measure(name: str) -> str:
    work, draws = REGIMES[name]
    began = time.process_time()
    found: list[Drawn] = []
    for seed in range(draws):
        found += work(np.random.default_rng([seed, len(name)]))
    errors, us, expanded, oracles, risks = np.array(found).T
    judged = bool(np.isfinite(risks).all())
    held = int(np.sum(np.abs(errors) > TOLERANCE if judged else np.abs(errors) <= expanded))
    low, high = binomtest(held, len(found)).proportion_ci(method="wilson")
    rms, u, oracle = (math.sqrt(float(np.mean(each**2))) for each in (errors, us, oracles))
    rms, u = (math.nan, float(risks.mean())) if judged else (rms, u)
    wide = f"{np.median(expanded / K95) / np.median(oracles):.2f}" if math.isfinite(oracle) else ""
    seconds = time.process_time() - began
    _say(f"{name}: {seconds:.0f} s", sys.stderr)
    share = f"{100 * held / len(found):.1f} ({100 * low:.1f}-{100 * high:.1f})"
    return f"|{name}|{len(found)}|{share}|{'' if judged else f'{rms:.2g}'}|{u:.2g}|{wide}|"


def _say(text: str, to: TextIO | None = None) -> None:
    print(text, file=to, flush=True)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--only", default="", help="regimes whose names contain this")
    only = asked.parse_args().only
    _say("|regime|values|held by U [%]|rms|u|U / oracle's|")
    _say("|---|---|---|---|---|---|")
    with ProcessPoolExecutor() as pool:
        for line in pool.map(measure, [name for name in REGIMES if only in name]):
            _say(line)


if __name__ == "__main__":
    main()

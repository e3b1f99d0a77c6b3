"""A camera with its coefficient: every region of a frame is measured alike."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import FieldCorrection
from radiometry.frame import Frame
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics, Signal, measure_signal
from radiometry.luminance import codes, method
from radiometry.luminance.application import apply_to_signal
from radiometry.luminance.averaging import SCATTER, Values, average_signals
from radiometry.luminance.coefficient import Coefficient
from radiometry.luminance.corrections import apply_corrections
from radiometry.luminance.effects import NOISE
from radiometry.luminance.lens import correct_signal
from radiometry.luminance.measured import AppliedLuminance, Effect
from radiometry.vignetting.lens import Lens, LensShare

Read = tuple[Signal, LensShare | None]


_GREENS = ("G1", "G2", "G")


@dataclass(frozen=True)
class CalibratedCamera:
    """Exposure, coefficient, lens and corrections with which every region of a frame is measured."""

    exposure: Exposure
    coefficient: Coefficient
    lens: Lens | None
    corrections: tuple[FieldCorrection, ...]

    def convert_signal(self, signal: Signal, share: LensShare | None) -> AppliedLuminance:
        """Return the luminance of a signal, corrected."""
        applied = apply_to_signal(signal, exposure=self.exposure, coefficient=self.coefficient, share=share)
        return apply_corrections(applied, self.corrections)

    def read_signal(self, frame: Frame, polygon: Polygon, *, of_grid: bool = False) -> Read:
        """Return the signal of a region, and V if vignetting is corrected."""
        statistics = method.extract(frame, polygon)
        if of_grid:
            _require_green(statistics, frame)
        signal = measure_signal(statistics, channel=self.coefficient.channel)
        if self.lens is None:
            return signal, None
        return correct_signal(
            frame,
            polygon,
            signal,
            self.lens,
            channel=self.coefficient.channel,
            dark_signal_dn=self.coefficient.dark_signal_dn,
        )

    def apply_to_region(
        self, read: Sequence[Read], *, drift: tuple[Values, float] | None = None
    ) -> AppliedLuminance:
        """Apply the coefficient to the mean of a region's signals.

        ``drift`` is that of the whole grid (see `averaging.find_drift`): the shared part of the scatter.
        """
        signal, scatter_dn = average_signals(
            [signal for signal, _ in read],
            dark_signal_dn=self.coefficient.dark_signal_dn,
            drift_rel=drift[0] if drift else None,
        )
        # V depends on the place alone
        applied = self.convert_signal(signal, read[0][1])
        if len(read) == 1:
            return applied
        per_dn = add_up(applied.effects, source=NOISE) / signal.standard_uncertainty_dn
        own = Effect(source=SCATTER, shared=drift is None, effect_cd_m2=scatter_dn * per_dn)
        more = [own]
        if drift is not None:
            shared = drift[1] * applied.luminance_cd_m2.value
            more.append(Effect(source=SCATTER, shared=True, effect_cd_m2=shared))
        effects = (*applied.effects, *more)
        u = math.hypot(*(effect.effect_cd_m2 for effect in effects))
        luminance = replace(applied.luminance_cd_m2, standard_uncertainty=u)
        return replace(applied, luminance_cd_m2=luminance, effects=effects)


def _require_green(statistics: tuple[ChannelStatistics, ...], frame: Frame) -> None:
    """Refuse a cell without green pixels, which would be measured with another colour than was calibrated."""
    if "G" in frame.cfa and not any(row.channel in _GREENS for row in statistics):
        raise InputRejected(
            codes.GRID_INVALID,
            "A cell of the grid holds no green pixel: take fewer rows or columns, or fly lower.",
        )


def add_up(effects: Sequence[Effect], *, shared: bool | None = None, source: str | None = None) -> float:
    """Add up the effects that are shared or not, or of one source."""
    return math.hypot(
        *(e.effect_cd_m2 for e in effects if shared in {None, e.shared} and source in {None, e.source})
    )

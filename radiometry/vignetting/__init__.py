"""Vignetting: the fraction V of the light that the lens transmits at every place, per f-number and channel.

The falloff is fitted to flat fields, in place of the profiles of the "Four Vision" report, 3.3.2::

    signal - dark = A V(r)          V(r) = 1 + k1 r^2 + k2 r^4 + k3 r^6 (+ k4 r^8 + k5 r^10)

The terms in brackets enter where the flats ask for them. r = 1 at half of the frame's diagonal, from a
fitted centre; dividing by V corrects.
"""

from typing import Final

from radiometry.specification import application, certificate, method, roles
from radiometry.specification.certificate import CertificateText, CoefficientEffect, CoefficientKind, Column
from radiometry.vignetting import blocks, codes, fit, lens, points, results, verdicts

_IN_CORNER: Final = CoefficientEffect(of="of the signal in the corner", factor=lambda _: 100.0)

SPEC: Final = method.MethodSpec(
    name="vignetting",
    label="Vignetting",
    description="The light falloff of a lens towards the corners, per f-number, from flat fields.",
    schema_version=1,
    roles=(roles.FLAT, roles.DARK),
    params=results.Params,
    result=results.Fit,
    features=blocks.Features,
    whole_frame=True,
    several_regions=True,
    coefficients=(
        CoefficientKind(name="corner_falloff", label="Corner falloff", units=("1",), effect=_IN_CORNER),
        *(
            CoefficientKind(name=name, label=name, units=("1",), effect=_IN_CORNER)
            for name in ("k1", "k2", "k3", "k4", "k5")
        ),
        CoefficientKind(name="centre_row_px", label="Centre row", units=("px",)),
        CoefficientKind(name="centre_col_px", label="Centre column", units=("px",)),
    ),
    findings=codes.FINDINGS,
    extract=lambda frame, regions, *, header, **_: blocks.extract_features(frame, regions, header=header),
    missing=method.drop_readings(points.missing),
    judge=lambda frames, rows, _, params: verdicts.judge(frames, rows, params),
    plan=method.drop_readings(verdicts.plan),
    grid=roles.Grid(rows="f_number"),
    find_gaps=method.drop_readings(verdicts.find_gaps),
    fit=method.drop_readings(fit.fit),
    list_coefficients=fit.list_coefficients,
    list_key_figures=results.list_key_figures,
    list_budgets=results.list_budgets,
    plots=results.PLOTS,
    certificate=CertificateText(
        procedure="Light falloff over the frame, one per f-number and channel, from frames of a uniform "
        "surface; centre and coefficients fitted by weighted least squares",
        equation="(N - D) / A = 1 + k1 r² + k2 r⁴ + k3 r⁶ (+ k4 r⁸ + k5 r¹⁰ where the flats ask for them), "
        "where r is the distance from the fitted centre in units of half the frame's diagonal",
        headlines=frozenset({"corner_falloff"}),
        columns=(
            certificate.FRAME,
            Column(name="role", head="role", form="text", share=0.7),
            Column(name="f_number", head="f/", share=0.6),
            Column(name="signal_share", head="signal", form="percent"),
            Column(name="saturated_share", head="saturated", form="percent"),
            Column(name="gradient_rel", head="gradient", form="percent"),
            Column(name="gradient_standard_uncertainty_rel", head="u(gradient)", form="percent"),
        ),
        traceability="The result is a ratio of light within one frame; no external standard enters. The "
        "frames themselves are tested for non-uniform light, which is reported among the flags.",
    ),
    exports=lens.EXPORTS,
    applied="channel_fits",
    correction=application.Correction(lens=lens.Lens, average_over_polygon=lens.average_over_polygon),
)

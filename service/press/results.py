"""Result sections of a luminance certificate: fit, budget and range per ISO value, models and points."""

from radiometry.drawing.text import in_step, write_unit
from radiometry.methods import get_method
from service.press.figures import degrees, expanded, extent, percent, plain
from service.press.sheet import Node, facts, figure, section, table


def result_sections(certificate: Node) -> list[Node]:
    """Return one section per ISO value, one that compares the models, and one of the points."""
    result = certificate["result"]
    budgets = {budget["iso"]: budget["lines"] for budget in certificate["budgets"]}
    return [
        *(_iso(certificate, fit, budgets[fit["coefficient"]["iso"]]) for fit in result["iso_fits"]),
        section("Models compared", [_models(result)]),
        section("Points of the fit", [_points(result)]),
    ]


def _iso(certificate: Node, fit: Node, budget: list[Node]) -> Node:
    result, draw = certificate["result"], get_method(certificate["method"]).draw
    c = fit["coefficient"]
    k, u = in_step(c["luminance_k"], c["luminance_k_standard_uncertainty"])
    dark, u_dark = in_step(c["dark_signal_dn"], c["dark_signal_standard_uncertainty_dn"])
    growth = ""
    if "dark_rate_dn_per_s" in c:
        rate, u_rate = in_step(c["dark_rate_dn_per_s"], c["dark_rate_standard_uncertainty_dn_per_s"])
        growth = (
            f", at {plain(c['dark_time_s'], 3)} s; it grows by {rate} DN/s with the exposure time, standard "
            f"uncertainty {u_rate} DN/s"
        )
    parameters = zip(c["parameter_names"], c["parameters"], strict=True)
    covariance = "; ".join(", ".join(f"{value:.4e}" for value in row) for row in c["covariance"])
    rows = [
        ["K", f"{k} {write_unit(c['luminance_k_unit'])}, standard uncertainty {u}"],
        ["Dark signal", f"{dark} DN, standard uncertainty {u_dark} DN{growth}"],
        ["Parameters", ", ".join(f"{name} = {plain(value, 8)}" for name, value in parameters)],
        ["Covariance", f"{covariance} (of the parameters, without the meter's calibration)"],
        ["Valid for", _range(c, certificate["vignetting"])],
        ["Expected", f"K about {plain(fit['expected_k'])} for a camera rated by ISO 12232"],
        ["Birge ratio", plain(fit["birge_ratio"], 4)],
    ]
    plot = draw({**result, "iso_fits": [fit]})
    caption = (
        f"ISO {plain(c['iso'])}: signal against X, linear and logarithmic, and residuals. "
        f"Hollow: excluded or rejected. Dashed: tolerance of {percent(result['tolerance_rel'])}."
    )
    blocks = [facts(rows), _budget(budget, write_unit(c["luminance_k_unit"])), *_apertures(certificate, c)]
    blocks.append(figure(plot, caption, width=1.0))
    return section(f"ISO {plain(c['iso'])}", blocks)


def _apertures(certificate: Node, c: Node) -> list[Node]:
    """Return the table of K at each f-number; nothing where a version has none."""
    rows = []
    for aperture in c.get("apertures", []):
        k, u = in_step(aperture["luminance_k"], aperture["luminance_k_standard_uncertainty"])
        rows.append(
            [
                f"f/{plain(aperture['f_number'])}",
                str(aperture["scenes"]),
                str(aperture["frames"]),
                k,
                u,
                *expanded(certificate, aperture["luminance_k"], aperture),
                degrees(aperture),
                f"{100 * (aperture['luminance_k'] / c['luminance_k'] - 1):+.2f} %",
            ]
        )
    head = [
        "f-number",
        "scenes",
        "frames",
        "K",
        "u(K)",
        "U(K)",
        "k",
        "dof",
        "from K of the ISO",
    ]
    caption = (
        f"K at each calibrated f-number [{write_unit(c['luminance_k_unit'])}], which a measurement at this "
        "f-number uses. At another f-number it uses K of the ISO value, with an f-number uncertain by "
        f"{percent(c['f_number_u_rel'])}."
    )
    return (
        [
            table(
                head,
                rows,
                align="lrrrrrrrr",
                widths=[1, 0.8, 0.8, 1, 0.9, 0.9, 0.6, 0.8, 1.5],
                caption=caption,
            )
        ]
        if rows
        else []
    )


def _range(c: Node, vignetting: str) -> str:
    times = ", ".join(f"{plain(time)} s" for time in c["exposure_times_s"])
    signals = extent(c["signal_range_dn"])
    return (
        f"ISO {plain(c['iso'])}; exposure times {times}; f-numbers {extent(c['f_number_range'])}; signals of "
        f"{signals} DN above dark; X of {extent(c['rhs_range'])} cd·s/m²; channel {c['channel']}; "
        f"exposure values {c['exposure_basis']}; the region drawn below; vignetting correction: {vignetting}"
    )


def _budget(lines: list[Node], unit: str) -> Node:
    rows = [
        [
            line["source"],
            line["kind"],
            f"{plain(line['input_uncertainty'], 3)} {line['input_unit']}".removesuffix(" 1"),
            plain(line["sensitivity"], 3) if "sensitivity" in line else "-",
            percent(line["u_rel"]),
            plain(line["u"], 3),
            percent(line["variance_share"]),
        ]
        for line in lines
    ]
    head = ["source", "type", "u(x)", "sensitivity", "u(K)/K", f"u(K) [{unit}]", "fraction of u²"]
    caption = (
        "Uncertainty budget of K of the ISO value. u(x) without a unit is relative. Type A: from scatter; "
        "type B: from other information."
    )
    return table(head, rows, align="llrrrrr", widths=[2, 0.6, 1.2, 1.1, 1.1, 2, 1.2], caption=caption)


def _models(result: Node) -> Node:
    rows = []
    for fit in result["iso_fits"]:
        for model in fit["models"]:
            named = zip(model["parameter_names"], model["parameters"], strict=True)
            rows.append(
                [
                    plain(fit["coefficient"]["iso"]),
                    model["model"],
                    ", ".join(f"{name} = {plain(value)}" for name, value in named),
                    f"{model['r_squared']:.6f}" if "r_squared" in model else "-",
                    f"{model['aicc']:.1f}" if "aicc" in model else "-",
                    percent(model["left_out_rms_rel"]) if "left_out_rms_rel" in model else "-",
                    percent(model["left_out_max_rel"]) if "left_out_max_rel" in model else "-",
                ]
            )
    head = ["ISO", "model", "parameters", "R²", "AICc", "rms", "largest"]
    caption = "rms, largest: leave-one-scene-out errors of luminance, each scene predicted from the others."
    return table(head, rows, align="rllrrrr", widths=[0.8, 1.3, 3.6, 1.1, 0.9, 1, 1], caption=caption)


def _points(result: Node) -> Node:
    rows = [
        [
            point["frame"],
            point["scene"],
            plain(point["iso"]),
            plain(point["exposure_time_s"]),
            plain(point["f_number"]),
            plain(point["luminance_cd_m2"]) if "luminance_cd_m2" in point else "-",
            plain(point["rhs"]) if "rhs" in point else "-",
            in_step(point["adjusted_signal_dn"], point["signal_standard_uncertainty_dn"])[0],
            f"{100 * point['residual_rel']:+.2f} %" if "residual_rel" in point else point["left_out"],
        ]
        for point in result["points"]
    ]
    head = ["frame", "scene", "ISO", "t [s]", "f/", "L [cd/m²]", "X", "N - D [DN]", "error in L"]
    caption = "error in L: against the meter, with K at the f-number of the point."
    widths = [2.2, 1.4, 0.8, 0.9, 0.6, 1, 1, 1.2, 1.4]
    return table(head, rows, align="llrrrrrrr", widths=widths, caption=caption)

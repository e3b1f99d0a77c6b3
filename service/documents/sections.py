"""Sections of a luminance certificate: meters, scenes, readings, fit, budget, models and corrections."""

from collections import defaultdict

from radiometry.drawing.text import in_step, natural_key, write_unit
from radiometry.methods import get_method
from service.documents.sheets import (
    Node,
    degrees,
    expanded,
    extent,
    facts,
    figure,
    flow,
    optional,
    percent,
    plain,
    region_blocks,
    section,
    stamp,
    table,
)


def evidence_sections(certificate: Node, preview: str) -> list[Node]:
    """Return the sections from the meters to the dark frames."""
    frames = certificate["frames"]
    return [
        section("Meters", [_meters(certificate)]),
        section("Scenes and readings", [_scenes(certificate), _readings(certificate)]),
        section("Region", region_blocks(certificate, preview)),
        section("Light frames", [_frames([f for f in frames if f["role"] == "light"])]),
        section("Dark frames", [_dark(certificate), _frames([f for f in frames if f["role"] == "dark"])]),
    ]


def _meters(certificate: Node) -> Node:
    if not certificate["meters"]:
        return flow("No meter is recorded for the readings.")
    rows = []
    for meter in certificate["meters"]:
        stated = meter.get("certificate", {})
        days = sorted({meter[name] for name in ("first_day", "last_day") if name in meter})
        rows.append(
            [
                meter["kind"],
                f"{meter['make']} {meter['model']}",
                meter["serial"],
                f"{stated['number']}\n{stated['laboratory']}" if stated else "none",
                f"{stated['issued_on']}\n{stated['due_on']}" if stated else "-",
                percent(stated["expanded_uncertainty_rel"]) if stated else "-",
                plain(stated["coverage_factor"]) if stated else "-",
                "\n".join(days) or "-",
            ]
        )
    head = ["kind", "meter", "serial", "certificate", "issued, due", "U", "k", "used"]
    return table(head, rows, align="lllllrrl", widths=[1.2, 1.6, 1.1, 2.2, 1.1, 0.8, 0.4, 1.1])


def _scenes(certificate: Node) -> Node:
    rows = [
        [
            scene["scene"],
            plain(scene["luminance_cd_m2"]),
            str(scene["readings"]),
            percent(scene["spread_rel"]),
            optional(scene, "illuminance_lx", plain),
            optional(scene, "illuminance_spread_rel", percent),
            optional(scene, "rho_e_pi_cd_m2", plain),
        ]
        for scene in sorted(certificate["result"]["scenes"], key=lambda each: natural_key(each["scene"]))
    ]
    head = ["scene", "L [cd/m²]", "readings", "range", "E [lx]", "range", "rho E/pi [cd/m²]"]
    return table(head, rows, align="lrrrrrr", widths=[2, 1, 0.8, 1, 1, 1, 1.2])


def _readings(certificate: Node) -> Node:
    rows = [
        [
            reading["scene"],
            reading["quantity"],
            f"{plain(reading['value'], 6)} {write_unit(reading['unit'])}",
            _entered(reading),
            reading.get("meter", "not recorded"),
            optional(reading, "taken_at", stamp),
        ]
        for reading in sorted(certificate["readings"], key=lambda each: natural_key(each["scene"]))
    ]
    head = ["scene", "quantity", "value", "as entered", "meter", "taken at"]
    return table(head, rows, align="llrrll", widths=[1.2, 1, 1.3, 1.3, 2.4, 1.9], caption="All readings.")


def _entered(reading: Node) -> str:
    if "entered_value" not in reading:
        return "-"
    return f"{plain(reading['entered_value'], 6)} {write_unit(reading['entered_unit'])}"


def _frames(frames: list[Node]) -> Node:
    rows = []
    for frame in sorted(frames, key=lambda each: natural_key(f"{each.get('scene', '')} {each['frame']}")):
        exposure = frame["exposure"]
        signal, u = in_step(frame["signal_dn"], frame["signal_standard_uncertainty_dn"])
        rows.append(
            [
                "\n".join([frame["frame"], *frame["warnings"]]),
                frame.get("scene", "-"),
                plain(exposure["exposure_time_s"]),
                plain(exposure["f_number"]),
                plain(exposure["iso"]),
                signal,
                u,
                frame["sha256"],
            ]
        )
    head = ["frame", "scene", "t [s]", "f/", "ISO", "N [DN]", "u(N)", "SHA-256"]
    return table(head, rows, align="llrrrrrh", widths=[2, 1.2, 0.8, 0.5, 0.8, 1.1, 0.7, 3])


def _dark(certificate: Node) -> Node:
    dark: dict[float, list[Node]] = defaultdict(list)
    for frame in certificate["frames"]:
        if frame["role"] == "dark":
            dark[frame["exposure"]["iso"]].append(frame)
    rows = []
    for fit in certificate["result"]["iso_fits"]:
        c = fit["coefficient"]
        value, u = in_step(c["dark_signal_dn"], c["dark_signal_standard_uncertainty_dn"])
        found = dark[c["iso"]]
        times = sorted({frame["exposure"]["exposure_time_s"] for frame in found})
        shown = ", ".join(plain(time) for time in times) or "no dark frames; black level of the files"
        rows.append([plain(c["iso"]), value, u, str(len(found)), shown])
    head = ["ISO", "D [DN]", "u(D)", "frames", "exposure times [s]"]
    caption = "Dark signal per ISO value: median of the frames taken with the lamp off, at their mean time."
    return table(head, rows, align="rrrrl", widths=[1, 1, 1, 1, 4], caption=caption)


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
    head = ["f-number", "scenes", "frames", "K", "u(K)", "U(K)", "k", "dof", "from K of the ISO"]
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

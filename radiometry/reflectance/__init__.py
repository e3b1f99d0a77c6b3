"""Reflectance method: its specification; `radiometry.reflectance.method` exports its functions."""

from typing import Final

from radiometry.frame import pose
from radiometry.reflectance import codes, indices, measurement, method, presentation, results, sun, sunshine
from radiometry.reflectance import method as reflectance_method
from radiometry.reflectance.findings import judge, plan, review_frame
from radiometry.reflectance.imaging import RADIANCE_UNIT, Features, extract_features
from radiometry.reflectance.panel_code import take_region
from radiometry.specification import application, certificate, roles
from radiometry.specification.method import MethodSpec

SPEC: Final = MethodSpec(
    name="reflectance",
    label="Reflectance",
    description="The coefficient K of each band of a multispectral camera with its sunshine sensor, from a "
    "panel of known reflectance.",
    schema_version=1,
    roles=(roles.PANEL,),
    applied_roles=(roles.FIELD,),
    params=results.Params,
    result=results.Fit,
    features=Features,
    reference="panel",
    reading=results.Reading,
    finds_region=True,
    manual_exposure=False,
    coefficients=(
        certificate.CoefficientKind(
            name="reflectance_k",
            label="Reflectance K",
            units=("1/s", "1", "sr", "m2*sr*nm/W", "s"),
            effect=certificate.CoefficientEffect(of="of the reflectance"),
        ),
    ),
    findings=codes.FINDINGS,
    check_frame=review_frame,
    extract=lambda frame, regions, *, header, exposure, **_: method.extract(
        frame, regions, header=header, exposure=exposure
    ),
    find_region=method.find_region,
    take_region=take_region,
    missing=method.missing,
    judge=judge,
    plan=plan,
    grid=roles.Grid(rows="capture_id", columns=("band",)),
    fit=method.fit,
    list_coefficients=method.list_coefficients,
    list_key_figures=presentation.list_key_figures,
    plots=presentation.PLOTS,
    of_one_flight=True,
    certificate=presentation.CERTIFICATE,
    application=application.BandApplication(
        quantity="reflectance",
        unit="1",
        options=("incidence_angle_deg", "index", "quantity"),
        conditions=pose.GroundHeight,
        summarise=measurement.summarise,
        read_formula=indices.read_formula,
        align_band=indices.align_band,
        flag_alignment=measurement.flag_alignment,
        move_regions=indices.move_regions,
        displace_region=indices.displace_region,
        find_scale_of_frame=reflectance_method.find_scale_of_frame,
        extract_features=extract_features,
        apply=reflectance_method.apply_features,
        measure_region=measurement.measure_region,
        measure_index=measurement.measure_index,
        band_map=indices.BandMap,
        compute_index=indices.compute_index,
        map_uncertainty=measurement.map_uncertainty,
        radiance_unit=RADIANCE_UNIT,
        require_radiance=measurement.require_radiance,
        measure_radiance=measurement.measure_radiance,
        scale_pixels=reflectance_method.scale_pixels,
        find_place=sun.find_place,
        change=reflectance_method.change_reflectance,
    ),
    applied="band_fits",
    measure_light=sunshine.measure_sunshine,
    list_budgets=presentation.list_budgets,
    configure=method.configure,
)

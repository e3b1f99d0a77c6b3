"""Application of a luminance version to a frame: region, grid and map."""

from typing import Final

from radiometry.luminance import application, change, codes, corners, lens, maps, measurement, surface
from radiometry.luminance.conditions import FieldConditions
from radiometry.specification.application import SurfaceApplication

APPLICATION: Final = SurfaceApplication(
    quantity="luminance",
    view=codes.OBSERVER_DIFFERS,
    unit="cd/m2",
    options=("grid", "reflectance", "frame_ids"),
    conditions=FieldConditions,
    name_channels=lens.name_channels,
    choose_coefficient=application.choose_coefficient,
    request=measurement.Request,
    correction=measurement.Vignetting,
    outline=surface.outline,
    check_grid=corners.check_grid,
    find_window=measurement.find_window,
    find_map_scale=maps.find_map_scale,
    needs_scale=measurement.needs_scale,
    measure=measurement.measure,
    compute_map=maps.compute_map,
    change=change.change_luminance,
    foresee=application.foresee_k,
    unforeseen=codes.F_NUMBER_NOT_CALIBRATED,
    rim_px=maps.RIM_PX,
)

"""Application of a reflectance version to a frame: the region and map of a band, or an index."""

from typing import Final

from radiometry.reflectance.application import apply_features, scale_pixels
from radiometry.reflectance.comparison import change_reflectance
from radiometry.reflectance.features import extract_features
from radiometry.reflectance.formula import read_formula
from radiometry.reflectance.imaging import RADIANCE_UNIT
from radiometry.reflectance.indices import BandMap, align_band, compute_index, displace_region, move_regions
from radiometry.reflectance.measurement import measure_region
from radiometry.reflectance.place import GroundHeight, find_place
from radiometry.reflectance.propagation import flag_alignment, map_uncertainty, measure_index
from radiometry.reflectance.radiance import measure_radiance, require_radiance
from radiometry.reflectance.scale import find_scale_of_frame
from radiometry.specification.application import BandApplication

APPLICATION: Final = BandApplication(
    quantity="reflectance",
    unit="1",
    options=("incidence_angle_deg", "index", "quantity"),
    conditions=GroundHeight,
    read_formula=read_formula,
    align_band=align_band,
    flag_alignment=flag_alignment,
    move_regions=move_regions,
    displace_region=displace_region,
    find_scale_of_frame=find_scale_of_frame,
    extract_features=extract_features,
    apply=apply_features,
    measure_region=measure_region,
    measure_index=measure_index,
    band_map=BandMap,
    compute_index=compute_index,
    map_uncertainty=map_uncertainty,
    radiance_unit=RADIANCE_UNIT,
    require_radiance=require_radiance,
    measure_radiance=measure_radiance,
    scale_pixels=scale_pixels,
    find_place=find_place,
    change=change_reflectance,
)

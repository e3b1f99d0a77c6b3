"""Application of a reflectance version to a frame: the region and map of a band, or an index."""

from typing import Final

from radiometry.reflectance import method
from radiometry.reflectance.comparison import change_reflectance
from radiometry.reflectance.measurement import measure_index, measure_region
from radiometry.specification.application import BandApplication

APPLICATION: Final = BandApplication(
    quantity="reflectance",
    unit="1",
    options=("incidence_angle_deg", "index"),
    name_bands=method.name_bands,
    align_region=method.align_region,
    find_scale_of_frame=method.find_scale_of_frame,
    extract_features=method.extract_features,
    apply=method.apply,
    measure_region=measure_region,
    measure_index=measure_index,
    compute_map=method.compute_map,
    band_map=method.BandMap,
    compute_index=method.compute_index,
    change=change_reflectance,
)

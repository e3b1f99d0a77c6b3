"""Ranges of the calculators' settings, and how many cases one request may ask for."""

from typing import Annotated

from pydantic import Field

from service.schemas.base import Number

MOST_CASES = 1000

# wider than any camera and any aircraft, narrower than what overflows
PixelPitch = Annotated[Number, Field(ge=0.01, le=1e4, description="Distance of neighbouring pixels.")]
FocalLength = Annotated[Number, Field(ge=0.01, le=1e5)]
EXPOSURE_TIMES_S = Field(ge=1e-9, le=86_400)
ExposureTime = Annotated[Number, EXPOSURE_TIMES_S]
Metres = Annotated[Number, Field(ge=1e-3, le=1e7)]

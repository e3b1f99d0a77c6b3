"""A version in the forms that other programs read."""

from pydantic import ConfigDict, Field

from service.schemas.base import Answer, Quantity


class DngVignetteAnswer(Answer):
    """FixVignetteRadial: gain = 1 + k0 r^2 + ... + k4 r^10, r = 1 at the corner farthest from the centre."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "f_number": 2.8,
                    "k": [0.2, 0.05, 0.01, 0.0, 0.0],
                    "centre_x_share": 0.5,
                    "centre_y_share": 0.5,
                    "largest_error_rel": 0.002,
                    "opcode_list_base64": "AAAAAQ==",
                }
            ]
        }
    )

    f_number: float
    k: list[float] = Field(min_length=5, max_length=5)
    centre_x_share: float = Field(description="0 at the first column, 1 at the last.")
    centre_y_share: float = Field(description="0 at the first row, 1 at the last.")
    largest_error_rel: float = Field(description="Of the gain times the fitted V, anywhere in the frame.")
    opcode_list_base64: str = Field(description="One opcode, big endian, as OpcodeList3 holds it.")


class CameraFile(Answer):
    """A camera's geometry with its uncertainties."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "examples": [
                {
                    "camera_name": "DJI FC6520 0K1XE8",
                    "model": "brown",
                    "convention": "first pixel's centre is (0, 0), x right, y down; OpenCV's order and signs",
                    "image_width_px": 5280,
                    "image_height_px": 3956,
                    "parameters": {"fx_px": {"value": 4580.1, "standard_uncertainty": 1.2, "unit": "px"}},
                }
            ]
        },
    )

    camera_name: str
    model: str
    convention: str
    image_width_px: int
    image_height_px: int
    parameters: dict[str, Quantity]

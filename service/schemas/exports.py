"""A version in the forms that other programs read."""

from pydantic import ConfigDict, Field, RootModel

from service.schemas.base import Answer, Quantity


class DngVignetteAnswer(Answer):
    """FixVignetteRadial: gain = 1 + k0 r^2 + ... + k4 r^10, r = 1 at the corner farthest from the centre."""

    f_number: float
    k: list[float] = Field(min_length=5, max_length=5)
    centre_x_share: float = Field(description="0 at the first column, 1 at the last.")
    centre_y_share: float = Field(description="0 at the first row, 1 at the last.")
    largest_error_rel: float = Field(description="Of the gain times the fitted V, anywhere in the frame.")
    opcode_list_base64: str = Field(description="One opcode, big endian, as OpcodeList3 holds it.")


class CameraFile(Answer):
    """A camera's geometry with its uncertainties."""

    model_config = ConfigDict(extra="allow")

    camera_name: str
    model: str
    convention: str
    image_width_px: int
    image_height_px: int
    parameters: dict[str, Quantity]


class OdmCameras(RootModel[dict[str, dict[str, float | str]]]):
    """Cameras by their name in OpenDroneMap: OpenSfM's model brown, lengths over the larger side."""

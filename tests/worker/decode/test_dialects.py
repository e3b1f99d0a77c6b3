"""One normalised band, whichever maker's dialect: real files and packets, and broken ones."""

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.exposure import Camera, SuppliedExposure, accept_frame
from radiometry.frame.multispectral import CAMERAS
from radiometry.frame.roi import Polygon, Window
from radiometry.reflectance import findings
from radiometry.reflectance.fit import unit_of_k
from radiometry.reflectance.imaging import FrameSize, compute_signal, evaluate_band, extract_features
from radiometry.reflectance.sunshine import measure_sunshine
from tests.support import reader
from tests.support.data import data_file
from tests.worker.decode.spectral_tiff import make_tiff, write_dji_xmp, write_micasense_xmp, write_sequoia_xmp
from worker.decode.dialects import BY_SYSTEM

# By DJI's guide, means over rows 500 to 799 and columns 650 to 949; the exposures in microseconds.
P4 = {
    "blue": (0.02069, 350),
    "green": (0.03171, 170),
    "red": (0.02423, 203),
    "red_edge": (0.09843, 328),
    "nir": (0.1594, 384),
}
REDEDGE_P = {"make": "MicaSense", "model": "RedEdge-P", "software": "v1.3.1"}
MAVIC = {"make": "DJI", "model": "M3M", "software": "10.05.01", "black": False}


@pytest.fixture
def read(save):
    def make(xmp, **tiff):
        return reader.read_header(save(make_tiff(xmp, **tiff), "band.tif"))

    return make


def expose(header):
    camera = Camera(make=header.make or "", model=header.model or "", serial=header.serial or "")
    return accept_frame(header, role="panel", supplied=SuppliedExposure(), camera=camera).exposure


def review(header):
    return [raised.flag for raised in findings.review_frame(header, exposure=expose(header))]


def settings_of(header):
    return expose(header).on_basis("nominal")


@pytest.mark.parametrize(("number", "band"), list(enumerate(P4, start=1)))
def test_real_p4_multispectral_gives_the_reflectance_of_dji_s_formula(number, band):
    path, (mean, exposure_us) = data_file(f"p4m/DJI_001{number}.TIF"), P4[band]
    header = reader.read_header(path)
    found = header.multispectral
    assert (found.system, found.band, found.kind, found.problem) == ("dji", band, None, None)
    assert (header.black_level_dn, header.white_level_dn) == ((4096.0,), (65472.0,))
    assert found.gain_model.exposure_time_s == pytest.approx(exposure_us * 1e-6)
    assert review(header) == []
    frame = reader.read_window(path, 500, 650, 300, 300)
    assert not (frame.samples_dn % 64).any()
    signal = compute_signal(frame, header=header, settings=settings_of(header))
    light = measure_sunshine(found)
    assert signal.mean() / light.i_ss == pytest.approx(mean, abs=5e-5 if mean > 0.1 else 5e-6)
    assert (unit_of_k(found, "sunshine"), unit_of_k(found, "panel_only"), light.unit) == ("s", "s", "1")


def test_real_p4_multispectral_states_place_attitude_and_lens():
    header = reader.read_header(data_file("p4m/DJI_0011.TIF"))
    found, angles = header.multispectral, {each.name: each.value for each in header.attitude}
    assert (header.latitude_deg, header.longitude_deg) == pytest.approx((40.49215399, -87.00107598), abs=2e-8)
    fix = header.position_fix
    uncertain = (fix.u_latitude_m, fix.u_longitude_m, fix.u_height_m)
    assert (fix.kind, *uncertain) == ("fixed", 0.0123, 0.01097, 0.02043)
    assert (angles["drone-dji:GimbalPitchDegree"], angles["drone-dji:FlightPitchDegree"]) == (-89.9, 6.0)
    # its file states 0, 0, 0 for the sensor, which hangs on the aircraft
    light = found.irradiance
    assert (light.yaw_deg, light.pitch_deg, light.roll_deg, light.quantity) == (89.9, 6.0, 1.4, "spectral")
    assert (light.value, light.unit, light.irradiance_w_m2_nm) == (7601.016, "1", None)
    lens = found.geometry
    assert (lens.focal_length_px, lens.focal_length_y_px) == (1959.9899902, 1951.1099854)
    assert lens.principal_point_px == pytest.approx((804.968994, 618.252014))
    assert lens.distortion == (-0.413425, 0.357198, -0.37005, 0.0009565, 0.0009565)
    assert (lens.homography[0], lens.homography[2], lens.calibrated_on) == (1.00473, 11.0607004, "2019-03-07")
    assert found.sunshine_serial == header.serial == "43e53d2eaaae3536b0fd1499da1d4389"


def test_ten_bits_are_saturated_at_65472(save):
    """With 65535 no sample of a P4 Multispectral would ever be saturated."""
    path = save(make_tiff(write_dji_xmp(), make="DJI", model="FC6360", brightest=65472), "band.tif")
    header = reader.read_header(path)
    frame = reader.read_window(path, 0, 0, 24, 32)
    whole = Polygon.from_points([(0, 0), (32, 0), (32, 24), (0, 24)])
    found = extract_features(frame, whole, header=header, exposure=expose(header))
    assert found.statistics.saturated_share == 1 / (24 * 32)
    assert found.i_sq_unit == "1/s"


def test_mavic_3_by_hand(read, save):
    """Its black is in the XMP alone; its polynomial multiplies; DJI has compensated its irradiance."""
    xmp = write_dji_xmp(SunSensor="9000", SunSensorYaw="80", SunSensorPitch="2", SunSensorRoll="-3")
    header = read(xmp, **MAVIC)
    found = header.multispectral
    assert (header.black_level_dn, header.black_level_origin) == ((3200.0,), "camera")
    assert (header.serial, found.imager_serial, found.sunshine_serial) == ("5A1B2C", "5A1B2C", "1581F5FK")
    light = found.irradiance
    assert (light.value, light.quantity, light.pitch_deg) == (9741.7, "compensated", 2.0)
    frame = reader.read_window(save(make_tiff(xmp, **MAVIC), "band.tif"), 12, 16, 1, 16)
    signal = compute_signal(frame, header=header, settings=settings_of(header))
    radius = np.arange(16)
    gain = 1 + 1e-4 * radius + 1e-6 * radius**2
    expected = gain * (frame.samples_dn[0] - 3200.0) / 65536 * 1.25 / (2.0 * 1250e-6)
    assert signal[0] == pytest.approx(expected, rel=1e-12)
    # where the tag of the file states another, the two are compared
    tagged = read(xmp, **(MAVIC | {"black": True}))
    assert (tagged.black_level_dn, review(tagged)) == ((4973.25,), ["black_level_disagrees"])


def test_offsets_of_bands_are_taken_from_a_p4_alone(read):
    """Of a Mavic, whose bands lie by CalibratedHMatrix, they have not been tried."""
    lens = {
        "DewarpData": "2019-03-07;1959.9,1951.1,4.9,-31.7,-0.41,0.35,0.0009,0.0009,-0.37",
        **{f"RelativeOpticalCenter{axis}": "2.5" for axis in "XY"},
    }
    assert read(write_dji_xmp(**lens), **MAVIC).multispectral.geometry.offset_px == (2.5, 2.5)
    lens["CalibratedHMatrix"] = "1,0,3,0,1,4,0,0,1"
    found = read(write_dji_xmp(**lens), **MAVIC).multispectral.geometry
    assert (found.offset_px, found.homography) == (None, (1, 0, 3, 0, 1, 4, 0, 0, 1))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"SensorGain": None}, "SensorGain is missing"),
        ({"ExposureTime": "0"}, "ExposureTime 0 us"),
        ({"SensorGainAdjustment": "nan"}, "SensorGainAdjustment is not a list of numbers"),
        ({"VignettingData": "1,2,three"}, "VignettingData is not a list of numbers"),
        ({"VignettingData": ",".join(["1e-9"] * 5000)}, "VignettingData has 5000 numbers, more than 64"),
        ({"VignettingData": "1e9,0"}, "relative illumination"),
        ({"VignettingData": "-1,0"}, "relative illumination"),
        ({"VignettingFlag": "1"}, "corrected the vignetting already"),
        ({"BlackLevel": None}, "black level"),
    ],
)
def test_what_makes_dji_s_formula_wrong_is_said_when_the_file_is_read(read, changes, said):
    with pytest.raises(InputRejected, match=said) as refusal:
        review(read(write_dji_xmp(**changes), **MAVIC))
    assert refusal.value.code == "sensor_model_unusable"


@pytest.mark.parametrize(("name", "corners"), [("blue", 0.51), ("nir", 0.487)])
def test_real_packets_of_a_rededge_p(read, name, corners):
    header = read(data_file(f"rededge-p/{name}.xmp").read_text(), **REDEDGE_P)
    found = header.multispectral
    assert (found.system, found.band, found.problem) == ("micasense_2d", name, None)
    assert len(found.vignetting_polynomial.coefficients) == 21
    size = FrameSize(height_px=1088, width_px=1456)
    share = evaluate_band(found, Window(row0=0, col0=0, height=1088, width=1456), size=size)
    assert share[544, 728] == pytest.approx(1.0, abs=0.02)
    assert share[0, 0] == pytest.approx(corners, abs=1e-3)
    at_corners = share[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert 0.41 < at_corners.min() < at_corners.max() < 0.58
    light = found.irradiance
    assert (light.quantity, light.unit_origin, light.file_unit) == ("horizontal", "model", "uW/cm2/nm")
    # by its own parts: the direct light on a level surface, and the scattered
    level = light.direct_w_m2_nm * np.sin(np.radians(light.solar_elevation_deg)) + light.scattered_w_m2_nm
    assert light.irradiance_w_m2_nm == light.horizontal_w_m2_nm == pytest.approx(level, rel=1e-6)
    attitude = (light.yaw_deg, light.pitch_deg, light.roll_deg)
    assert attitude == pytest.approx((33.503, -21.204, 1.610), abs=1e-3)
    assert review(header) == []


def test_radiance_of_a_rededge_p_by_hand(read, save):
    """ISO 206 and 3 ms are the small file's; a1, a2, a3 and V the camera's."""
    xmp = data_file("rededge-p/blue.xmp").read_text()
    header = read(xmp, **REDEDGE_P)
    frame = reader.read_window(save(make_tiff(xmp, **REDEDGE_P), "band.tif"), 6, 8, 1, 1)
    (signal,) = compute_signal(frame, header=header, settings=settings_of(header))[0]
    lens = header.multispectral.vignetting_polynomial
    pairs = zip(lens.exponents, lens.coefficients, strict=True)
    share = sum(c * (8 / 32) ** i * (6 / 24) ** j for (i, j), c in pairs)
    time_s = 0.003 + 9.079776e-9 * 6 - 2.160492e-5 * 0.003 * 6
    expected = (5000 + 6 * 32 + 8 - 4973.25) / 65536 / share * 1.890798e-4 / (206 / 100) / time_s
    assert signal == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("model", "software", "trusted"),
    [
        ("RedEdge-P", "v1.0.0", True),
        ("RedEdge-P", "v1.3.1", True),
        ("Altum-PT", "v1.1.0", True),
        ("Altum", "v1.2.2", False),
        ("Altum", "v1.2.3", True),
        ("RedEdge-M", "v5.1.6", False),
        ("RedEdge-MX", "v7.5.0-beta6", True),
        ("RedEdge", "v5.1.7", True),
        ("RedEdge-P", "", False),
        ("NewEdge", "v9.0.0", False),
    ],
)
def test_horizontal_irradiance_is_trusted_by_model_and_firmware(read, model, software, trusted):
    xmp = write_micasense_xmp(SpectralIrradiance="125", HorizontalIrradiance="110")
    told = read(xmp, make="MicaSense", model=model, software=software).multispectral
    found = told.irradiance
    assert found.irradiance_w_m2_nm == pytest.approx(1.10 if trusted else 1.25)
    assert (found.distrust is None) is trusted
    if not trusted:
        assert model in found.distrust
        assert measure_sunshine(told).left_out == (found.distrust,)


def test_irradiance_that_no_sky_has_is_not_used(read):
    """The first generation writes W/m2/nm: 110 of them are a mistaken unit."""
    found = read(write_micasense_xmp(SpectralIrradiance="110"), make="MicaSense").multispectral
    assert (found.irradiance, found.sunshine_missing[:11]) == (None, "110 W/m2/nm")


@pytest.mark.parametrize(("band", "kind"), [("LWIR", "thermal"), ("Panchro", "panchromatic")])
def test_thermal_and_panchromatic_bands_are_named_and_left_out(read, band, kind):
    header = read(write_micasense_xmp(band=band, lens=False), make="MicaSense", model="Altum-PT")
    assert header.multispectral.kind == kind
    (raised,) = findings.review_frame(header, exposure=expose(header))
    assert raised.flag == "frame_left_out"
    assert raised.detail.startswith(f"Band {band} is {kind}")


def test_panel_that_the_camera_recognised_is_read_with_its_place(read):
    xmp = write_micasense_xmp(SpectralIrradiance="1").replace(
        "<Camera:BandName>",
        "<MicaSense:PanelSerial>RP06-2024187-OB</MicaSense:PanelSerial><Camera:Albedo>0.51</Camera:Albedo>"
        "<Camera:ReflectArea>10,11,20,11,20,21,10,21</Camera:ReflectArea><Camera:BandName>",
    )
    found = read(xmp, make="MicaSense").multispectral
    assert (found.panel_serial, found.panel_albedo) == ("RP06-2024187-OB", 0.51)
    assert found.panel_region == ((10, 11), (20, 11), (20, 21), (10, 21))


@pytest.mark.parametrize(
    ("xmp", "said"),
    [
        (write_sequoia_xmp(SensorModel="1,2"), "SensorModel has 2 numbers, not 3"),
        (write_sequoia_xmp(SensorModel="310316.1,nan,4773.6"), "SensorModel is not a list of numbers"),
        (write_sequoia_xmp(SensorModel="0,3067.5,0"), "no positive response"),
        (write_sequoia_xmp(SensorModel="310316.1,-9000,4773.6"), "black level of -9000"),
        (write_sequoia_xmp(VignettingPolynomial2D="1," * 5000), "more than 64"),
        (write_sequoia_xmp(VignettingPolynomial2DName="0,0,1"), "3 exponents for 3 coefficients"),
        (write_sequoia_xmp(VignettingPolynomial2DName="0,0,1,0,0,9"), "not whole from 0 to 8"),
        (write_sequoia_xmp(VignettingPolynomial2D="0,0,0"), "relative illumination of 0 to 0"),
        (write_sequoia_xmp(VignettingPolynomial2D="1e14,0,0"), "relative illumination"),
    ],
)
def test_absurd_metadata_of_a_sequoia_is_said_when_the_file_is_read(read, xmp, said):
    with pytest.raises(InputRejected, match=said) as refusal:
        review(read(xmp))
    assert refusal.value.code == "sensor_model_unusable"


def test_another_camera_is_refused_by_its_name_with_those_that_work(read):
    header = read(write_sequoia_xmp(SensorModel=None), make="Sentera", model="6X Thermal")
    with pytest.raises(InputRejected, match="The camera Sentera 6X Thermal does not say") as refusal:
        review(header)
    assert all(cameras in refusal.value.message for cameras in CAMERAS.values())


def test_every_camera_that_is_named_has_a_dialect():
    assert list(BY_SYSTEM) == list(CAMERAS)
    assert all(len(dialect.IDENTITIES) == 2 for dialect in BY_SYSTEM.values())

"""Boards and cameras that are known, and OpenCV's own pictures."""

import dataclasses

import cv2
import numpy as np

from radiometry.fitting.evidence import FrameEvidence, Region
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon
from radiometry.geometry import method as geometry
from radiometry.geometry.camera import CameraModel
from simulation.geometry import draw_poses, make_header, simulate_rows

BOARD = geometry.Target(kind="checkerboard", columns=9, rows=6, square_size_mm=25.0)
CHARUCO = geometry.Target(
    kind="charuco", columns=7, rows=5, square_size_mm=30.0, marker_size_mm=18.0, dictionary="DICT_4X4_50"
)
CAMERA = CameraModel(
    height_px=480,
    width_px=640,
    fx_px=520.0,
    fy_px=515.0,
    cx_px=332.0,
    cy_px=229.0,
    k1=-0.25,
    k2=0.08,
    p1=0.0008,
    p2=-0.0006,
    k3=-0.01,
)
SQUARE = dataclasses.replace(CAMERA, fy_px=520.0)
FREE = geometry.Params(fix_aspect_ratio=False)


def simulate(*, seed, count, noise_px, camera=CAMERA, target=BOARD, tilt_deg=35.0):
    random = np.random.default_rng(seed)
    poses = draw_poses(camera, target, random, count=count, tilt_deg=tilt_deg)
    return simulate_rows(camera, target, poses, random, noise_px=noise_px)


def whole(frame):
    width, height = frame.width_px, frame.height_px
    corners = [(0, 0), (width, 0), (width, height), (0, height)]
    return [Region(name="", polygon=Polygon.from_points(corners))]


def extract(frame, *, target=BOARD, bits=8):
    size = dataclasses.replace(CAMERA, height_px=frame.height_px, width_px=frame.width_px)
    header = make_header(size, cfa=frame.cfa, bits=bits)
    return geometry.extract(frame, whole(frame), header=header, exposure=None, target=target)


def read_picture(path):
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    height, width = picture.shape
    frame = Frame(
        samples_dn=picture.astype(np.uint16),
        row0=0,
        col0=0,
        height_px=height,
        width_px=width,
        cfa="grey",
        black_level_dn=(0.0,),
        white_level_dn=(255.0,),
    )
    found = extract(frame)
    return FrameEvidence(
        frame=path.name,
        role="chart",
        scene=None,
        header=make_header(dataclasses.replace(CAMERA, height_px=height, width_px=width), bits=8),
        exposure=None,
        statistics=found.statistics,
        features=found.features,
    )


def transpose(row):
    """The same picture with rows and columns exchanged."""
    features = row.features
    return dataclasses.replace(
        row,
        features=dataclasses.replace(
            features,
            height_px=features.width_px,
            width_px=features.height_px,
            fixed_px=tuple((col, row) for row, col in features.fixed_px),
            fitted_px=tuple((col, row) for row, col in features.fitted_px),
        ),
    )


def with_features(row, **changes):
    return dataclasses.replace(row, features=dataclasses.replace(row.features, **changes))


def values(fit):
    return {each.name: each.value for each in fit.coefficients}


def errors(fit):
    return {each.name: each.standard_uncertainty for each in fit.coefficients}


def raised(fit):
    return {flag.flag for flag in fit.flags}

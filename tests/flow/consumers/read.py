"""Read what the service wrote with the programs that it is written for: `python read.py PART FOLDER`.

Runs in an environment of those programs. Prints a list of rows: the program with its
version, the file, what is compared, the largest deviation and its unit.
"""

import json
import re
import shutil
import subprocess
import sys
import warnings
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROWS = []
STILL = np.zeros(3)


def add(program, file, compared, deviation, unit=""):
    ROWS.append([program, file, compared, float(deviation), unit])


def largest(found, wanted):
    return np.abs(np.asarray(found, float) - np.asarray(wanted, float)).max()


def load_camera(folder):
    stated = json.loads((folder / "camera.json").read_text())
    values = {name: each["value"] for name, each in stated["parameters"].items()}
    size = stated["image_width_px"], stated["image_height_px"]
    matrix = np.array(
        [[values["fx_px"], 0, values["cx_px"]], [0, values["fy_px"], values["cy_px"]], [0, 0, 1.0]]
    )
    return size, matrix, np.array([values[name] for name in ("k1", "k2", "p1", "p2", "k3")])


def geometry(folder):
    import cv2

    (width, height), matrix, distortion = load_camera(folder)
    lattice = np.stack(np.meshgrid(np.linspace(0, width - 1, 25), np.linspace(0, height - 1, 19)), -1)
    places = lattice.reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-14)
    directions = cv2.undistortPointsIter(places, matrix, distortion, None, None, stop)[:, 0]
    spatial = np.column_stack([directions, np.ones(len(directions))])
    seen = cv2.projectPoints(spatial, STILL, STILL, matrix, distortion)[0][:, 0]

    storage = cv2.FileStorage(str(folder / "opencv.yaml"), cv2.FILE_STORAGE_READ)
    read = [storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients")]
    off = max(largest(read[0], matrix), largest(read[1][0], distortion))
    add(f"OpenCV {cv2.__version__}, FileStorage", "opencv.yaml", "matrix and coefficients", off)
    opendronemap(folder, spatial, seen)


def opendronemap(folder, spatial, seen):
    from orthority import camera as cameras
    from orthority import param_io

    ((_, stated),) = param_io.read_osfm_int_param(folder / "cameras.json").items()
    camera = cameras.create_camera(stated.pop("cam_type"), **stated, xyz=(0, 0, 0), opk=(0, 0, 0))
    # a camera without rotation looks down, with y up
    found = camera.world_to_pixel((spatial * (1, -1, -1)).T).T
    program = f"OpenDroneMap's model, orthority {version('orthority')}"
    add(program, "cameras.json", "475 points, projected by orthority", largest(found, seen), "px")


def maps(folder):
    warnings.simplefilter("ignore")
    read_map(folder / "map.tif")
    if (folder / "placed.tif").exists():
        read_map(folder / "placed.tif")
    else:
        add("rasterio", "placed.tif", "the real frame is not here: not read", np.nan)


def read_map(path):
    import pystac
    import rasterio
    from pystac.validation.local_validator import LocalValidator

    item = json.loads(path.with_suffix(".json").read_text())
    (asset,) = (each for each in item["assets"].values() if "data" in each["roles"])
    program = f"rasterio {rasterio.__version__}, GDAL {rasterio.__gdal_version__}"
    with rasterio.open(path) as file:
        wanted = np.load(path.with_suffix(".npy")).reshape(file.count, *file.shape)
        same = np.nan_to_num(file.read()) - np.nan_to_num(wanted)
        add(program, path.name, "every pixel of every plane, against tifffile", np.abs(same).max())
        assert [each["name"] for each in asset["eo:bands"]] == list(file.descriptions)
        assert [each["unit"] for each in asset["raster:bands"]] == list(file.units)
        assert all(map(np.isnan, file.nodatavals))
        lineage = json.dumps([file.tags(), *map(file.tags, file.indexes)])
        sources = re.findall(r"SHA-256 (\w{64})", item["properties"]["processing:lineage"])
        assert len(sources) == 2
        assert all(each in lineage for each in sources)
        if path.stem == "placed":
            assert file.crs.to_epsg() == asset["proj:epsg"] == 4326
            off = largest(list(file.transform)[:6], asset["proj:transform"])
            add(program, path.name, "transformation to EPSG:4326, against its STAC item", off, "degrees")
    read = pystac.Item.from_file(str(path.with_suffix(".json")))
    errors = LocalValidator()._validate_from_local(
        f"https://schemas.stacspec.org/v{pystac.get_stac_version()}/item-spec/json-schema/item.json",
        read.to_dict(),
    )
    assert not list(errors), errors
    compared = f"the schema of STAC {pystac.get_stac_version()} accepts the item of {path.name}; errors"
    add(f"pystac {version('pystac')}", "stac.json", compared, len(list(errors)))


def certificates(folder):
    import dcclib.validation.schematron
    from lxml import etree

    wanted = json.loads((folder / "certificate.json").read_text())["coefficients"]
    path = folder / "certificate.xml"
    result = dcclib.validation.schematron.SchematronValidator.for_dcc().validate_file(str(path))
    failed = [each for each in result.failed_assertions if each.role != "warning"]
    assert not failed, failed
    program = f"PTB's dcclib {version('dcclib')}"
    add(program, "certificate.xml", "Schematron rules that fail, without warnings", len(failed))
    # the only one: there is a later version, whose schema was not to be had
    assert [each.test for each in result.failed_assertions] == ["@schemaVersion='3.3.0'"]
    spaces = {"si": "https://ptb.de/si"}
    values = [float(each.text) for each in etree.parse(path).iterfind(".//si:real/si:value", spaces)]
    off = largest(values, [row["value"] for row in wanted])
    add(f"lxml {version('lxml')}", "certificate.xml", f"{len(values)} coefficients", off)
    if shutil.which("qpdf"):
        checked = subprocess.run(["qpdf", "--check", str(folder / "certificate.pdf")], check=False)
        add("qpdf", "certificate.pdf", "faults", checked.returncode)


def series(folder):
    """Compare the frames that the code of docs/dashboards.md made, in `page.py`, with the JSON."""
    names = {}
    exec(compile((folder / "page.py").read_text(), "page.py", "exec"), names)
    rows = json.loads((folder / "coefficients.json").read_text())["rows"]
    for name, frame in names["frames"].items():
        for column in ("value", "standard_uncertainty", "iso"):
            wanted = [np.nan if row[column] is None else row[column] for row in rows]
            found = frame[column].to_numpy()
            assert len(found) == len(rows)
            assert (np.isnan(found.astype(float)) == np.isnan(np.array(wanted, float))).all()
            np.testing.assert_array_equal(found.astype(float), np.array(wanted, float), name)
        assert [each or "" for each in frame["serial"].to_list()] == [row["serial"] or "" for row in rows]
        moments = [str(each)[:19].replace(" ", "T") for each in frame["valid_from"].to_list()]
        assert moments == [row["valid_from"][:19] for row in rows], name
        add(name, "series", f"{len(rows)} rows: numbers, names and times", 0)


if __name__ == "__main__":
    globals()[sys.argv[1]](Path(sys.argv[2]))
    print(json.dumps(ROWS))

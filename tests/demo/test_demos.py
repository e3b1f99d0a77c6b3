"""Every demo finds the truth over HTTP; a second time it ends the same."""

import pytest
from rich.console import Console

from demo import __main__
from demo.__main__ import play
from demo.journey import Display, Stage
from radiometry.methods import METHODS
from tests.support.house import furnished
from tests.support.live import serving
from tests.support.printed import read_blocks, type_in


@pytest.fixture(scope="module")
def live(migrated_sqlite, tmp_path_factory):
    """The service over loopback, with its worker in this process."""
    with furnished(migrated_sqlite, tmp_path_factory.mktemp("live")) as house, serving(house) as served:
        yield served


def go(method, team, folder, camera=""):
    display = Display(Console(width=120))
    stage = Stage(client=team.client, folder=folder, display=display, quick=True, camera=camera)
    return play(method, stage)


@pytest.mark.parametrize(
    "method", [spec.name for spec in METHODS if spec.name not in {"luminance", "vignetting"}]
)
def test_the_truth_is_found(live, method, tmp_path, capsys):
    with live.team() as team:
        assert go(method, team, tmp_path), capsys.readouterr().out
        shown = capsys.readouterr().out
        assert f"{method} beside the simulated truth" in shown
        assert "version 1 is published" in shown


def test_the_truth_of_a_road_is_found(live, tmp_path, capsys):
    with live.team() as team:
        assert go("road", team, tmp_path), capsys.readouterr().out
        assert "conforms by C3" in capsys.readouterr().out
        assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


def test_the_truth_is_found_with_another_multispectral_camera(live, tmp_path, capsys):
    """Its flight is then measured with the commands that docs/reflectance.md prints."""
    with live.team() as team:
        assert go("reflectance", team, tmp_path, "p4m"), capsys.readouterr().out
        assert "NDVI" in capsys.readouterr().out
        (campaign,) = team.client.campaigns(project_number="DEMO-FLIGHT")
        team.client.change_campaign(campaign.id, project_number="FLIGHT")
        typed = "".join(read_blocks("docs/reflectance.md"))
        address = {"STILB_URL": team.url, "STILB_KEY": team.key}
        type_in(tmp_path, typed, **address)
        # of two captures, an index each and a map of the bands for each of five frames
        assert len([*(tmp_path / "maps").glob("*.tif")]) == 2 + 2 * 5


def test_the_second_time_finds_the_same_truth_and_changes_nothing(live, tmp_path, capsys):
    with live.team() as team:
        tables = []
        for _ in range(2):
            assert go("vignetting", team, tmp_path), capsys.readouterr().out
            shown = capsys.readouterr().out
            tables.append(shown[shown.index("vignetting beside") :])
        assert tables[0] == tables[1]
        assert len(list(team.client.campaigns())) == 1


@pytest.mark.parametrize("was_there", [True, False])
def test_only_a_folder_that_the_demo_made_is_removed(tmp_path, monkeypatch, was_there):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("STILB_DATA", raising=False)
    monkeypatch.delenv("METHOD", raising=False)
    monkeypatch.setattr(__main__.signal, "signal", lambda *_: None)
    modes = []
    monkeypatch.setattr(
        __main__,
        "_run",
        lambda _, __, data, *___, **____: modes.append(data.parent.stat().st_mode & 0o777) or 0,
    )
    if was_there:
        (tmp_path / "stilb-data").mkdir()
    assert __main__.main() == 0
    assert [each.name for each in tmp_path.iterdir()] == ["stilb-data"] * was_there
    assert was_there or modes == [0o700]

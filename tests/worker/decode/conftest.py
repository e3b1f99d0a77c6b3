import pytest

from tests.support.data import data_file


@pytest.fixture(scope="session")
def real_files():
    return data_file(".")


@pytest.fixture
def save(tmp_path):

    def write(content, name="frame.dng"):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return write

"""What `make release` accepts and refuses."""

import hashlib
import subprocess
import zipfile

import pytest
from packaging.version import Version

from tests.support.compose import ROOT, load_script


@pytest.fixture(scope="module")
def release():
    return load_script("release")


@pytest.fixture
def tree(tmp_path):
    """A repository with one commit."""
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "stilb"\nversion = "1.2.3"\n')
    (tmp_path / "CHANGELOG.md").write_text(
        "# Change log\n\n## Unreleased\n\n## 1.2.3 - 2026-11-22\n\n- A.\n\n## 1.2.2\n"
    )
    git(tmp_path, "init", "-q")
    commit(tmp_path)
    return tmp_path


def git(root, *arguments):
    who = ["-c", "user.name=a", "-c", "user.email=a@b"]
    subprocess.run(["git", "-C", root, *who, *arguments], check=True, capture_output=True)


def commit(root):
    git(root, "add", "-A")
    git(root, "commit", "-q", "--allow-empty", "-m", "c")


def test_release_accepts_a_committed_version_with_its_entry(release, tree):
    for check in (release.check_version, release.check_change_log, release.check_tree):
        assert check(tree).right is True, check(tree)


def test_version_of_another_commits_tag_is_refused(release, tree):
    git(tree, "tag", "v1.2.3")
    assert release.check_version(tree).right is True
    commit(tree)
    assert release.check_version(tree).right is False


def test_development_version_is_refused(release, tree):
    (tree / "pyproject.toml").write_text('[project]\nversion = "1.2.3.dev1"\n')
    assert release.check_version(tree).right is False


@pytest.mark.parametrize(
    "text",
    [
        "",
        "## Unreleased\n- A.\n",
        "## 1.2.3\n- A.\n",
        "## 1.2.4 - 2026-11-22\n- A.\n",
        "## 1.2.3 - 2026-11-22\n",
    ],
)
def test_change_log_without_this_release_is_refused(release, tree, text):
    (tree / "CHANGELOG.md").write_text(text)
    assert release.check_change_log(tree).right is False


def test_uncommitted_file_is_refused_by_name(release, tree):
    (tree / "new.py").write_text("")
    found = release.check_tree(tree)
    assert (found.right, "new.py" in found.detail) == (False, True)


@pytest.mark.parametrize(
    ("version", "files", "fault"),
    [
        ("1.2.3", ["stilb/__init__.py"], ""),
        ("1.2.4", ["stilb/__init__.py"], "is stilb 1.2.4"),
        ("1.2.3", ["stilb/__init__.py", "store/a.py"], "also holds store"),
        ("1.2.3", [], "lacks 1 files, first: stilb/__init__.py"),
    ],
)
def test_wheel_of_another_version_room_or_with_a_gap_is_refused(release, tmp_path, version, files, fault):
    wheel = tmp_path / "stilb-1.2.3-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name in files:
            archive.writestr(name, "")
        archive.writestr(f"stilb-{version}.dist-info/METADATA", f"Name: stilb\nVersion: {version}\n")
    committed = ["stilb/__init__.py"]
    found = release.inspect_wheel(wheel, name="stilb", version="1.2.3", rooms=["stilb"], committed=committed)
    assert (found.right, found.detail.endswith(fault)) == (not fault, True)


def test_one_failed_check_fails_the_release(release, capsys):
    checks = [release.Check(name="a", right=each, detail="d") for each in (True, True)]
    assert release.report(iter(checks)) == 0
    assert release.report(iter([*checks, release.Check(name="tree", right=False, detail="d")])) == 1
    assert "FAILED" in capsys.readouterr().out


def test_released_migrations_are_unchanged_and_others_are_listed_at_a_release(release, tmp_path):
    assert release.check_migrations(ROOT, at_release=False).right
    versions = tmp_path / "migrations" / "versions"
    versions.mkdir(parents=True)
    (versions / "0001_first.py").write_text("a")
    listed = tmp_path / "migrations" / "released.sha256"
    listed.write_text("")
    assert "sha256sum versions/0001_first.py" in release.check_migrations(tmp_path).detail
    listed.write_text(f"{hashlib.sha256(b'b').hexdigest()}  versions/0001_first.py\n")
    assert release.check_migrations(tmp_path, at_release=False).right is False


def test_version_of_this_repository_is_its_release_or_comes_after_it(release):
    """What has changed since a release is not that release."""
    version = Version(release.read_version(ROOT))
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased, _, released = text.partition("## Unreleased")[2].partition("\n## ")
    newest = Version(released.partition(" ")[0])
    if "\n- " in unreleased:
        assert version.is_devrelease
        assert version > newest
    else:
        assert version == newest or version.is_devrelease

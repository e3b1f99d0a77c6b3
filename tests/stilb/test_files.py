"""What a file's name says of the frame in it."""

import hashlib
import os
import unicodedata

import pytest

from stilb.field.files import ANY_RULES, Rule, sort_files
from stilb.field.push import Journal, Watch
from stilb.receipt import compare_card


def lay(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(name.encode())
    return folder


def said(folder, *rules, **options):
    files, left_out = sort_files(folder, rules or ANY_RULES, **options)
    return {file.name: (file.role, file.scene) for file in files}, left_out


def test_letters_put_together_in_two_ways_are_the_same(tmp_path):
    """macOS writes an accent apart from its letter, keyboards and other systems do not."""
    lay(tmp_path, *(unicodedata.normalize("NFD", name) for name in ("dunkel/Küste 1.DNG", "Dämmerung/a.DNG")))
    rules = Rule(role="dark", pattern="küste*"), Rule(role="light", pattern="{scene}/*")
    found, left_out = said(tmp_path, *rules)
    assert (sorted(found.values(), key=str), left_out) == ([("dark", None), ("light", "Dämmerung")], [])
    receipt = {
        "files": [{"name": name, "sha256": hashlib.sha256(name.encode()).hexdigest()} for name in found]
    }
    for file in receipt["files"]:
        file["name"] = unicodedata.normalize("NFC", file["name"])
    assert compare_card(receipt, tmp_path) == []
    assert (
        Rule(role="dark", first="Küste 1.DNG", last=unicodedata.normalize("NFD", "Küste 1.DNG")).match(
            unicodedata.normalize("NFD", "Küste 1.DNG")
        )
        == {}
    )


@pytest.mark.parametrize(
    ("rule", "name", "scene"),
    [
        (Rule(role="light", pattern="{scene}_*.dng"), "any/where/L1_004.DNG", "l1"),
        (Rule(role="light", pattern="**/{scene}/*.tif"), "a/b/Level-2/x.tif", "Level-2"),
        (Rule(role="light", pattern="x?.dng", scene="s"), "x1.DNG", "s"),
        (Rule(role="light", first="DJI_0003.DNG", last="dji_0005.dng", scene="s"), "100/DJI_0005.DNG", "s"),
        (Rule(role="light", first="DJI_0003.DNG", pattern="*.jpg", scene="s"), "DJI_0004.JPG", "s"),
    ],
)
def test_a_rule_that_fits(rule, name, scene, tmp_path):
    assert said(lay(tmp_path, name), rule)[0] == {name: ("light", scene)}


@pytest.mark.parametrize(
    ("rule", "name"),
    [
        (Rule(role="light", pattern="a/*"), "b/a.DNG"),
        (Rule(role="light", pattern="a/*"), "a/b/c.DNG"),
        (Rule(role="light", pattern="a.dng"), "axdng"),
        (Rule(role="light", first="DJI_0003.DNG", last="DJI_0005.DNG"), "DJI_0006.DNG"),
        (Rule(role="light", first="DJI_0003.DNG", last="DJI_0005.DNG"), "DJI_0002.DNG"),
        (Rule(role="light", first="DJI_0003.DNG"), "DJI_0004.JPG"),
        (Rule(role="light", pattern="*"), ".Trashes/a.DNG"),
    ],
)
def test_a_rule_that_does_not(rule, name, tmp_path):
    assert said(lay(tmp_path, name), rule)[0] == {}


def test_the_first_rule_decides(tmp_path):
    rules = (Rule(role="dark", pattern="*_dark.dng"), Rule(role="light", pattern="*.dng"))
    assert said(lay(tmp_path, "a_dark.dng", "b.dng"), *rules)[0] == {
        "a_dark.dng": ("dark", None),
        "b.dng": ("light", None),
    }


def test_a_hash_is_read_once_and_again_when_the_file_changes(tmp_path, monkeypatch):
    path = lay(tmp_path / "card", "ü.DNG") / "ü.DNG"
    kept = tmp_path / "journals"
    first = Journal.of(tmp_path / "card", kept).hash_of(path)
    with monkeypatch.context() as unplugged:
        unplugged.setattr("hashlib.file_digest", None)
        assert Journal.of(tmp_path / "card", kept).hash_of(path) == first
    stamp = path.stat()
    path.write_bytes(path.read_bytes()[::-1])
    os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns + 2_000_000_000))
    assert Journal.of(tmp_path / "card", kept).hash_of(path) != first


def test_a_line_that_a_crash_cut_off_spoils_no_other(tmp_path):
    folder = lay(tmp_path / "card", "a.DNG", "b.DNG")
    kept = tmp_path / "journals"
    before = Journal.of(folder, kept)
    hashes = [before.hash_of(folder / name) for name in ("a.DNG", "b.DNG")]
    (journal,) = kept.iterdir()
    journal.write_bytes(journal.read_bytes()[:-20])
    after = Journal.of(folder, kept)
    assert [after.hash_of(folder / name) for name in ("b.DNG", "a.DNG")] == hashes[::-1]
    assert [Journal.of(folder, kept).hash_of(folder / name) for name in ("a.DNG", "b.DNG")] == hashes


def test_a_file_that_grows_while_it_is_read_is_no_frame_yet(tmp_path, monkeypatch):
    folder = lay(tmp_path / "card", "a.DNG")
    path = folder / "a.DNG"
    whole = hashlib.file_digest

    def meanwhile(file, name):
        path.write_bytes(b"longer than before")
        return whole(file, name)

    monkeypatch.setattr("hashlib.file_digest", meanwhile)
    with pytest.raises(OSError, match="still being written"):
        Journal.of(folder, tmp_path / "journals").hash_of(path)


def test_a_file_is_given_when_two_looks_agree_and_again_when_it_changes(tmp_path):
    folder = lay(tmp_path, "dark/a.DNG")
    watch = Watch(lambda: sort_files(folder, ANY_RULES)[0])
    assert watch.look() == []
    (given,) = watch.look()
    assert (given.name, watch.look()) == ("dark/a.DNG", [])
    (folder / "dark/a.DNG").write_bytes(b"changed")
    assert watch.look() == []
    assert watch.look() == [given]
    watch.take_back([given])
    assert watch.look() == [given]


def test_a_card_that_is_pulled_out_and_put_in_again(tmp_path):
    folder = lay(tmp_path, "dark/a.DNG")
    files = sort_files(folder, ANY_RULES)[0]
    watch = Watch(lambda: files)
    watch.look()
    (folder / "dark/a.DNG").rename(folder / "away")
    assert watch.look() == []
    (folder / "away").rename(folder / "dark/a.DNG")
    assert watch.look() == []
    assert watch.look() == files

"""Flags are words with a meaning."""

from radiometry.findings.flags import Flag


def test_every_flag_has_a_word_and_a_sentence():
    for flag in Flag:
        assert flag.value == flag.name.lower()
        assert flag.meaning.endswith(".")
        assert f"{flag}" == flag.value


def test_a_flag_is_found_by_its_word():
    assert Flag("lamp_drift") is Flag.LAMP_DRIFT

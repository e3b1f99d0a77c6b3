"""How far the decoders are shut in: told at the start, and refused where the operator asks for more."""

import logging

import pytest

from store.sandbox import Sandbox
from worker.decode.pool import DecoderUnavailable
from worker.process import start_decoders

FULL = Sandbox(no_new_privs=True, landlock=7, seccomp=True)
OLD_KERNEL = Sandbox(no_new_privs=True, landlock=0, seccomp=True)


class Decoders:
    def __init__(self, sandbox):
        self.sandbox = sandbox

    def start(self):
        return self.sandbox


def test_require_refuses_a_kernel_that_lacks_a_part_and_names_it():
    with pytest.raises(DecoderUnavailable, match=r"require.*no landlock_files"):
        start_decoders(Decoders(OLD_KERNEL), require=True)
    assert start_decoders(Decoders(FULL), require=True)["level"] == "full"


def test_auto_works_with_less_and_says_what_is_missing(caplog):
    with caplog.at_level(logging.INFO):
        told = start_decoders(Decoders(OLD_KERNEL), require=False)
    assert (told["level"], told["landlock_files"], told["seccomp"]) == ("seccomp only", False, True)
    assert "decoder sandbox: seccomp only (no_new_privs, seccomp)" in caplog.messages
    assert any("no landlock_files" in line for line in caplog.messages)

"""The decoding process: what it may not know, may not use, and that its end is nobody else's."""

import json
import os
import signal
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from radiometry.findings import InputRejected, files, shared
from simulation.dng import LONG
from tests.support import reader
from tests.support.processes import alive, wait_until
from tests.worker.decode.dng_variants import Variant, expected_samples, make_dng, make_samples
from worker.decode.pool import DecoderCrashed, DecoderLimits, DecoderPool, DecoderUnavailable

SAMPLES = make_samples(64, 96, 14)
VARIANT = Variant(bits=14, active_area=(2, 4, 62, 90))
ROOT = Path(__file__).parents[3]


@pytest.fixture
def good(save):
    return save(make_dng(SAMPLES, VARIANT), "good.dng")


@pytest.fixture(scope="module")
def pool():
    with DecoderPool() as shared:
        yield shared


def test_answers_are_those_of_the_reader(pool, good):
    assert pool.read_header(good) == reader.read_header(good)
    frame = pool.read_window(good, (3, 5, 20, 30))
    np.testing.assert_array_equal(frame.samples_dn, expected_samples(SAMPLES, VARIANT)[3:23, 5:35])
    assert frame.black_level_dn == reader.read_window(good, 3, 5, 20, 30).black_level_dn
    assert (frame.row0, frame.col0, frame.height_px, frame.width_px) == (3, 5, 60, 86)
    assert pool.inspect(good, 40) == (reader.render_preview(good, 40), reader.prove(good))


def test_refusals_come_through_and_cost_no_process(pool, good, save):
    pool.read_header(good)
    before = pool.pids()
    with pytest.raises(InputRejected, match="GIF picture") as caught:
        pool.read_header(save(b"GIF89a", "x.dng"))
    assert caught.value.code is files.NOT_A_RAW_FILE
    with pytest.raises(InputRejected) as caught:
        pool.read_window(good, (0, 0, 1000, 1000))
    assert caught.value.code is shared.ROI_OUTSIDE_FRAME
    with pytest.raises(FileNotFoundError):
        pool.read_header(good.with_name("absent.dng"))
    assert pool.pids() == before


def test_rewritten_file_is_read_anew(pool, save):
    for variant, width_px in ((VARIANT, 86), (Variant(bits=14), 96)):
        assert pool.read_header(save(make_dng(SAMPLES, variant))).width_px == width_px


def _opened(pid):
    """The files that a process has open; one that it closes while they are listed is none."""
    found = set()
    for place in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):
            found.add(str(place.readlink()))
    return {name for name in found if name.startswith("/") and "dev/null" not in name}


def test_nothing_secret_is_inherited(good, save, monkeypatch):
    monkeypatch.setenv("STILB_DATABASE_URL", "postgresql://secret")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    secret = os.open(save(b"secret", "secret"), os.O_RDONLY)
    os.set_inheritable(secret, True)
    try:
        with DecoderPool() as pool, pool.hold(good):
            pool.read_header(good)
            zygote, cell = pool.pids()
            environments = [Path(f"/proc/{pid}/environ").read_bytes() for pid in (zygote, cell)]
            opened = _opened(zygote) | _opened(cell)
    finally:
        os.close(secret)
    assert all(b"secret" not in each and b"STILB" not in each for each in environments)
    assert opened == set()


def test_limits_follow_from_the_frame(pool, good):
    with pool.hold(good):
        pool.read_header(good)
        _, pid = pool.pids()
        limits = Path(f"/proc/{pid}/limits").read_text().splitlines()
    found = {line[:25].strip(): line[26:67].split() for line in limits}
    soft, hard = map(int, found["Max address space"])
    assert soft < hard // 2 < hard == 3 << 30
    assert found["Max core file size"] == found["Max file size"] == ["0", "0"]
    assert int(found["Max open files"][1]) <= 16
    assert int(found["Max cpu time"][0]) < 10


def test_killed_while_idle_is_not_noticed(pool, good):
    pool.read_header(good)
    os.kill(pool.pids()[0], signal.SIGKILL)
    # a zombie whose other threads still end holds its pipes open: it is gone when it can be waited for
    wait_until(lambda: os.waitid(os.P_PID, pool.pids()[0], os.WEXITED | os.WNOHANG | os.WNOWAIT))
    assert pool.read_header(good).width_px == 86


def test_what_is_no_file_of_its_own_is_refused_at_once(pool, tmp_path):
    pipe = tmp_path / "pipe.dng"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path):
        with pytest.raises(InputRejected) as caught:
            pool.read_header(path)
        assert caught.value.code is files.NOT_A_RAW_FILE


def _sparse(path, side):
    """A frame of side x side zeros that takes no space on the disk."""
    head = make_dng(SAMPLES[:16, :16], Variant(extra={256: (LONG, side), 257: (LONG, side)}))
    tags = {256: (LONG, side), 257: (LONG, side), 278: (LONG, side)}
    tags |= {273: (LONG, len(head) + 64), 279: (LONG, 2 * side**2)}
    path.write_bytes(make_dng(SAMPLES[:16, :16], Variant(extra=tags)))
    os.truncate(path, len(head) + 64 + 2 * side**2)
    return path


def test_a_file_that_needs_too_much_memory(good, tmp_path):
    large = _sparse(tmp_path / "large.dng", 12_000)
    with DecoderPool(DecoderLimits(memory_bytes=600 << 20)) as pool:
        assert pool.read_header(large).width_px == 12_000
        with pytest.raises(DecoderCrashed, match="more memory than is allowed"):
            pool.read_window(large, (0, 0, 12_000, 12_000))
        assert pool.read_header(good).width_px == 86


def _read_often(pool, path):
    """Reads of one file add up in its cell, until one ends beyond its allowance of whole seconds."""
    with pool.hold(path):
        for _ in range(200):
            pool.read_window(path, (0, 0, 15_000, 15_000))


def test_a_file_that_needs_too_much_time(good, tmp_path):
    slow = _sparse(tmp_path / "slow.dng", 15_000)
    with DecoderPool(DecoderLimits(cpu_seconds=0)) as pool:
        with pytest.raises(DecoderCrashed, match="ended by SIGXCPU"):
            _read_often(pool, slow)
        assert pool.read_header(good).width_px == 86


def test_parents_sudden_death_leaves_nothing_behind(good):
    code = (
        "import sys, time, pathlib; from worker.decode.pool import DecoderPool\n"
        "pool = DecoderPool(); pool.read_header(pathlib.Path(sys.argv[1]))\n"
        "print(pool.pids()[0], flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", code, str(good)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as parent:
        pid = int(parent.stdout.readline())
        assert alive([pid])
        parent.kill()
    wait_until(lambda: not alive([pid]))


def test_child_dies_although_somebody_holds_its_pipe_open():
    # The parent named is not the one that started it, as after the parent's death; the pipe stays open.
    command = [sys.executable, "-m", "worker.decode", "--parent", "1"]
    command += ["--memory-bytes", str(2 << 30), "--cpu-seconds", "5"]
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, its, subprocess.Popen(command, cwd=ROOT, stdin=its.fileno()) as child:
        assert child.wait() == 0


def test_a_process_that_cannot_start_is_our_fault(good, monkeypatch):
    with DecoderPool() as pool:
        monkeypatch.setattr(sys, "executable", "/bin/false")
        with pytest.raises(DecoderUnavailable):
            pool.read_header(good)
        monkeypatch.undo()
        assert pool.read_header(good).width_px == 86


def test_threads_share_the_processes(good):
    expected = reader.read_header(good)
    with DecoderPool() as pool:
        with ThreadPoolExecutor(5) as threads:
            assert list(threads.map(lambda _: pool.read_header(good), range(50))) == [expected] * 50
        assert len(pool.pids()) <= 2


FORKS = """
import os, pathlib, signal, sys, time
from worker.decode.pool import DecoderPool
path, pool = pathlib.Path(sys.argv[1]), DecoderPool()
pool.start()
zygote = pool.pids()[0]
fork = os.fork()
if not fork:
    pool.share()
    with pool.hold(path):
        pool.read_header(path)
        before = pool.pids()
        os.kill(zygote, signal.SIGKILL)
        while os.path.exists(f"/proc/{before[1]}"):
            time.sleep(0.01)
        pool.read_window(path, (0, 0, 16, 16))
        after = pool.pids()
    os._exit(not (before[0] == zygote and len(before) == len(after) == 2 and not set(before) & set(after)))
while (ended := os.waitpid(fork, os.WNOHANG))[0] == 0:
    pool.look_after()
    time.sleep(0.02)
pool.read_header(path)
pool.close()
sys.exit(os.waitstatus_to_exitcode(ended[1]))
"""


def test_a_fork_has_cells_of_the_same_zygote_which_its_owner_replaces(good):
    done = subprocess.run([sys.executable, "-c", FORKS, str(good)], cwd=ROOT, check=False)
    assert done.returncode == 0


def test_parent_needs_no_decoder_itself():
    code = "import sys, json; import worker.decode.pool; print(json.dumps([n for n in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True)
    assert not {"rawpy", "imagecodecs"} & set(json.loads(done.stdout))

"""A cell: what it may not do, that it sees one file only, and what its end means for the file."""

import json
import os
import platform
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from radiometry.findings import InputRejected, files
from simulation.dng import LONG
from store.sandbox import Restrictions, Sandbox, build_filter
from tests.support import reader
from tests.support.processes import alive, wait_until
from tests.worker.decode.dng_variants import Variant, make_dng, make_samples
from worker.decode.pool import DecoderCrashed, DecoderKilled, DecoderLimits, DecoderPool

SAMPLES = make_samples(64, 96, 14)
linux = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() not in {"x86_64", "aarch64"}, reason="Linux's own"
)


@pytest.fixture
def good(save):
    return save(make_dng(SAMPLES, Variant(bits=14)), "good.dng")


@contextmanager
def obeying():
    """A pool whose cells obey their files."""
    command = [sys.executable, "-s", "-P", "-m", "tests.worker.decode.probing"]
    with DecoderPool(DecoderLimits(wall_seconds=1.5)) as pool:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("worker.decode.pool.build_command", lambda _module: command)
            pool.start()
        yield pool


@pytest.fixture(scope="module")
def hostile():
    with obeying() as pool:
        yield pool


@pytest.fixture(scope="module")
def pool():
    with DecoderPool() as pool:
        yield pool


@pytest.fixture
def world(tmp_path, monkeypatch):
    """What a hostile file would like to reach."""
    monkeypatch.setenv("STILB_KEY", "a secret")
    for name in ("key", "database", "stored"):
        (tmp_path / name).write_bytes(b"a secret")
    with socket.socket() as tcp, socket.socket(socket.AF_UNIX) as unix:
        tcp.bind(("127.0.0.1", 0))
        tcp.listen()
        unix.bind(str(tmp_path / "unix"))
        unix.listen()
        found = {name: str(tmp_path / name) for name in ("key", "database", "stored", "unix")}
        samples = SAMPLES[20, :32].tobytes().hex()
        yield found | {"tcp": tcp.getsockname()[1], "worker": os.getpid(), "samples": samples}


@linux
def test_a_cell_that_was_taken_over_reaches_nothing(world, good):
    stored = Path(world["stored"])
    stored.write_bytes(b"PROBE" + json.dumps(world).encode())
    before = stored.read_bytes()
    # started in this environment, which has a secret
    with obeying() as pool:
        if pool.start().level != "full":
            pytest.skip("this kernel has no full sandbox")
        assert world["samples"] in pool.read_window(good, (0, 0, 64, 96)).samples_dn.tobytes().hex()
        with pytest.raises(InputRejected) as caught:
            pool.read_header(stored)
    assert json.loads(caught.value.message) == []
    assert stored.read_bytes() == before
    assert not Path(world["stored"] + ".new").exists()


@linux
def test_the_same_probe_outside_a_cell_reaches_the_world(world):
    code = "import json, sys; from tests.worker.decode import probing as at\n"
    # what a process has read and freed is found again in the memory that it owns
    code += "import numpy as np; from worker.decode import zygote; zygote.own_memory()\n"
    code += "world = json.loads(sys.argv[1])\n"
    code += "np.frombuffer(bytes.fromhex(world['samples']) * 50_000, np.uint8).copy()\n"
    code += "print(json.dumps(at.probe(world)))"
    done = subprocess.run([sys.executable, "-c", code, json.dumps(world)], capture_output=True, check=True)
    found = set(json.loads(done.stdout))
    usual = {
        *("reads the key", "reads the database", "looks at the database", "has a secret", "connects by TCP"),
        *("connects by a path", "runs a shell", "forks", "starts a thread", "writes the stored file"),
        *("signals the worker", "has itself signalled", "makes memory executable", "moves the worker"),
    }
    assert found >= usual | {"finds another file's samples"}


@linux
def test_landlock_alone_holds_on_the_second_thread_too():
    code = """
from store.sandbox import Restrictions
from worker.decode import pieces
restrictions = Restrictions()
restrictions._filter = []
held = restrictions.shut_in(pieces.start_second_thread)
opened = []
def read(_piece):
    try:
        opened.append(open("/etc/passwd").read(1))
    except PermissionError:
        opened.append(None)
pieces.decode_all(read, range(2))
print(held.level, len(pieces._second), opened)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    if not done.stdout.startswith("landlock only 1"):
        pytest.skip("no Landlock here, or one processor")
    assert done.stdout == "landlock only 1 [None, None]\n"


@linux
def test_both_architectures_know_the_same_calls():
    one, other = (build_filter(machine) for machine in ("x86_64", "aarch64"))
    assert len(one) - len(other) == 4  # x32, and poll, which newer systems do without
    assert build_filter("riscv64") == []


@pytest.mark.parametrize(
    ("parts", "level", "lacks"),
    [
        ((True, 7, True), "full", ()),
        ((True, 1, True), "full", ()),
        ((True, 0, True), "seccomp only", ("landlock_files",)),
        ((True, 3, False), "landlock only", ("seccomp",)),
        ((False, 0, False), "none", ("no_new_privs", "landlock_files", "seccomp")),
    ],
)
def test_levels_say_what_lacks(parts, level, lacks):
    no_new_privs, landlock, seccomp = parts
    found = Sandbox(no_new_privs=no_new_privs, landlock=landlock, seccomp=seccomp)
    assert (found.level, found.lacks, found.parts["landlock_network"]) == (level, lacks, landlock > 3)


def test_without_linux_nothing_is_lost_and_nothing_breaks(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    assert Restrictions().shut_in() == Sandbox(no_new_privs=False, landlock=0, seccomp=False)


def test_each_file_has_a_process_of_its_own_and_waits_for_no_other(pool, good, save):
    other = save(make_dng(SAMPLES[::-1].copy(), Variant(bits=14)), "other.dng")
    seen = []
    for path in (good, other, good):
        with pool.hold(path):
            pool.read_header(path)
            first = pool.pids()
            pool.read_window(path, (0, 0, 16, 16))
            pool.inspect(path, 40)
            assert pool.pids() == first
            seen.append(first[-1])
        assert pool.pids() == first[:1]
    assert len(set(seen)) == 3
    with pool.hold(good), pool.hold(other):
        for path in (good, other, good, other):
            pool.read_header(path)
        assert len(pool.pids()) == 3


def test_nothing_is_imported_after_the_fork(good, real_files):
    """A cell cannot open a module's file any more."""
    code = """
import sys
from pathlib import Path
from worker.decode import zygote
from tests.support import reader
from radiometry.findings import InputRejected
zygote.load_late_imports()
class Spy:
    def find_spec(self, name, path=None, target=None):
        print("late:", name)
sys.meta_path.insert(0, Spy())
for path in map(Path, sys.argv[1:]):
    file = reader.open_reader(path)
    header = file.read_header()
    file.read_window(reader.Window(0, 0, header.height_px, header.width_px))
    file.inspect(1600)
"""
    names = ("dng/blackmagic_bigendian_ljpeg_tiled.dng", "checkerboard/left01.jpg", "p4m/DJI_0011.TIF")
    names += ("sequoia/IMG_180413_080658_0000_NIR.TIF", "rededge/0000SET_000_IMG_0000_1.tif")
    command = [sys.executable, "-c", code, good, *(real_files / name for name in names)]
    done = subprocess.run(command, capture_output=True, check=True, timeout=120, text=True)
    assert done.stdout == ""


def _kill_when_busy(pool, number, times=1):
    """End the cells that come after the zygote, as somebody from outside would."""

    def work():
        killed = set()
        while len(killed) < times:
            for pid in pool.pids()[1:]:
                if pid not in killed:
                    time.sleep(0.1)
                    os.kill(pid, number)
                    killed.add(pid)
            time.sleep(0.01)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_a_cell_killed_from_outside_is_replaced_once(hostile, save):
    spins = save(b"SPIN" + bytes(100), "spins")
    killer = _kill_when_busy(hostile, signal.SIGKILL)
    # the second one spins for its whole time; on a busy machine it may not get a processor for that
    with pytest.raises((DecoderCrashed, DecoderKilled), match=r"(longer than|stood still for) 1\.5 s"):
        hostile.read_header(spins)
    killer.join()


@pytest.mark.parametrize(
    ("ends_by", "times", "told"), [(signal.SIGTERM, 2, DecoderKilled), (signal.SIGSEGV, 1, DecoderCrashed)]
)
def test_a_cell_killed_twice_says_nothing_of_its_file_and_one_that_crashes_once_does(
    hostile, save, ends_by, times, told
):
    spins = save(b"SPIN" + bytes(100), "spins")
    killer = _kill_when_busy(hostile, ends_by, times=times)
    with pytest.raises(told, match=ends_by.name):
        hostile.read_header(spins)
    killer.join()


def test_a_cell_that_stands_still_is_not_its_files_fault(hostile, save):
    with pytest.raises(DecoderKilled, match="stood still"):
        hostile.read_header(save(b"WAIT" + bytes(100), "waits"))


def test_the_zygotes_death_is_nobodys_fault(good):
    with DecoderPool() as pool, pool.hold(good):
        pool.read_header(good)
        before = pool.pids()
        os.kill(before[0], signal.SIGKILL)
        wait_until(lambda: not alive(before[1:]), what="the end of the cell without its zygote")
        assert pool.read_window(good, (0, 0, 16, 16)).samples_dn.shape == (16, 16)
        assert not set(before) & set(pool.pids())


def _without_dng_version(content):
    """The tag that makes it a DNG becomes another, so that LibRaw takes it for some other camera's file."""
    tag = bytes.fromhex("c612 0001 0000 0004")
    assert content.count(tag) == 1
    return content.replace(tag, bytes.fromhex("c611 0001 0000 0004"))


def test_neither_a_clean_cell_nor_a_dirty_process_gives_anything_of_another_file(pool, real_files, save):
    folder = real_files / "dng"
    names = ("blackmagic_bigendian_ljpeg_tiled.dng", "canon_14bit_packed_activearea_zero_exif.dng")
    undecoded = save(_without_dng_version((folder / names[0]).read_bytes()))
    with pytest.raises(InputRejected) as caught:
        pool.inspect(undecoded)
    assert caught.value.code is files.TRUNCATED
    for _ in range(3):
        # in this very process, whose memory then holds other frames' samples
        for name in names:
            whole = reader.read_header(folder / name)
            held = reader.read_window(folder / name, 0, 0, whole.height_px, whole.width_px).samples_dn.copy()
            del held
        with pytest.raises(InputRejected) as caught:
            reader.read_header(undecoded)
        assert caught.value.code is files.TRUNCATED


@pytest.mark.parametrize("compression", [7, 8, 5, 32773])
def test_a_claim_that_the_file_cannot_back_is_refused_before_anything_is_allocated(pool, save, compression):
    claims = {256: (LONG, 15_000), 257: (LONG, 16_000), 278: (LONG, 16_000)}
    claims |= {259: (LONG, compression), 279: (LONG, 64)}
    path = save(make_dng(SAMPLES[:16, :16], Variant(extra=claims)))
    began = time.process_time()
    with pytest.raises(InputRejected, match="far larger than its data can hold") as caught:
        pool.read_header(path)
    assert time.process_time() - began < 5
    assert caught.value.code is files.SIZE_MISMATCH

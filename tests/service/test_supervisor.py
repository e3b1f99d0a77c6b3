"""The launcher's promises, kept with real processes and a real Valkey: what starts together dies together."""

import os
import signal
import socket
import sqlite3
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
import redis

from service.launch.run import Roster, Wanted, _find_obstacle, launch
from service.launch.supervisor import AwakeClock, Part
from service.up import ROSTER, give_grace
from tests.support.disks import filled, small_disk
from tests.support.launcher import launched, ready
from tests.support.processes import alive, family, marked, wait_until
from tests.support.waiting import status_of

GIVEN = "given-to-the-launcher-by-its-environment"


@pytest.mark.parametrize(
    ("answer", "obstacle"),
    [
        (b"200 OK\r\n\r\n", ""),
        (
            b'503 Service Unavailable\r\n\r\n{"detail":"Not ready (files): It hangs."}',
            "Not ready (files): It hangs.",
        ),
        (b"503 Service Unavailable\r\n\r\n", "it refuses"),
    ],
)
def test_the_service_is_ready_when_it_says_so_and_else_says_what_is_in_the_way(answer, obstacle):
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor(1) as pool:
        asked = pool.submit(_find_obstacle, *server.getsockname())
        with server.accept()[0] as connection:
            assert connection.recv(1000).startswith(b"GET /readyz ")
            connection.sendall(b"HTTP/1.1 " + answer)
        assert asked.result() == obstacle


def test_a_broker_that_does_not_answer_is_told_and_it_serves(tmp_path):
    with launched(tmp_path, parts=("serve",), STILB_BROKER_URL="redis://127.0.0.1:1/0") as process:
        ready(process)
        process.terminate()
        told = "stilb: no broker answers at 127.0.0.1: jobs wait for it; see STILB_BROKER_URL\n"
        assert process.communicate(timeout=90)[1] == told


def children_named(process, name):
    found = []
    for pid in marked(process.mark) - {process.pid}:
        try:
            command = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        except OSError:
            continue
        if command[:-1] == process.args:
            continue  # a fork that reads the settings
        if name in command or Path(command[0]).name == name:
            found.append(pid)
    return found


def hint(socket_path):
    return redis.Redis(unix_socket_path=str(socket_path))


def test_it_says_in_one_line_where_it_serves_and_a_signal_stops_everything_in_order(tmp_path):
    keys = []
    for settings, sig in (({}, signal.SIGINT), ({"STILB_KEY": GIVEN}, signal.SIGHUP)):
        with launched(tmp_path, parts=("serve", "parent"), **settings) as process:
            address, key = ready(process)
            assert status_of(f"{address}/readyz") == 200
            assert address.startswith("http://127.0.0.1:")
            keys.append(key)
            process.send_signal(sig)
            assert (process.wait(90), process.communicate()) == (0, ("", ""))
            assert marked(process.mark) == set()
            assert not (tmp_path / "valkey.sock").exists()
    assert keys == [(tmp_path / "key").read_text().strip(), GIVEN]


def test_a_part_that_does_not_heed_the_stop_is_killed(tmp_path):
    with launched(tmp_path, parts=("serve", "stubborn"), STILB_KEY=GIVEN) as process:
        assert ready(process)[1] == GIVEN
        log = tmp_path / "logs" / "stubborn.log"
        # nor is it given a key, which it does not need
        wait_until(lambda: log.read_text() == "deaf, without the key\n")
        process.terminate()
        assert process.wait(90) == 0
        assert "stubborn did not stop within 1 s and is killed" in process.stderr.read()
        assert marked(process.mark) == set()


def test_a_second_signal_does_not_wait(tmp_path):
    with launched(tmp_path, parts=("serve", "stubborn"), STILB_TEST_STOP_S="3600") as process:
        ready(process)
        wait_until(lambda: "deaf" in (tmp_path / "logs" / "stubborn.log").read_text())
        process.terminate()
        wait_until(lambda: not children_named(process, "serve"), "the end of what heeds the stop")
        process.terminate()
        assert process.wait(90) == 0
        assert marked(process.mark) == set()


def test_nothing_outlives_a_killed_launcher_nor_hinders_the_next(tmp_path):
    with launched(tmp_path) as process:
        ready(process)
        tree = family(process.pid)
        assert len(tree) == 4
        process.kill()
        wait_until(lambda: not alive(tree))
        assert marked(process.mark) == set()
    with launched(tmp_path) as successor:
        ready(successor)
        assert hint(tmp_path / "valkey.sock").ping()


def test_nothing_outlives_a_launcher_killed_while_it_starts(tmp_path):
    with launched(tmp_path, before=("wait",)) as process:
        wait_until(lambda: len(marked(process.mark)) >= 3)
        process.kill()
        wait_until(lambda: not marked(process.mark))


def test_a_signal_while_it_starts_stops_it(tmp_path):
    with launched(tmp_path, parts=("wait",)) as process:
        wait_until(lambda: children_named(process, "wait"))
        process.terminate()
        assert process.wait(90) == 0
        assert process.stdout.read() == ""


def test_a_killed_child_is_started_again_without_its_leftovers(tmp_path):
    with launched(tmp_path, parts=("serve", "parent")) as process:
        address, _ = ready(process)
        wait_until(lambda: len(children_named(process, "wait")) == 1)

        def serves():
            try:
                return status_of(f"{address}/readyz") == 200 and hint(tmp_path / "valkey.sock").ping()
            except redis.ConnectionError:
                return False

        for name in ("serve", "parent", "valkey-server"):
            (before,) = children_named(process, name)
            leftovers = family(before)
            os.kill(before, signal.SIGKILL)
            wait_until(lambda gone=leftovers: not alive(gone))
            wait_until(lambda name=name: children_named(process, name), f"another {name}")
            wait_until(serves)
        process.terminate()
        told = process.communicate(timeout=90)[1]
        assert told.count("was killed by SIGKILL and is started again (log: ") == 3


def test_a_child_that_does_not_stay_alive_ends_all_and_names_its_log(tmp_path):
    with launched(tmp_path, parts=("serve", "fail")) as process:
        assert process.wait(60) == 1
        last = process.stderr.read().splitlines()[-1]
        assert (
            last == f"stilb: fail ended with exit code 7, 6 times within 60 s: read {tmp_path}/logs/fail.log"
        )
        assert marked(process.mark) == set()


def test_a_part_that_is_stopped_amid_a_transaction_is_killed_before_others_give_up_the_lock(tmp_path):
    wait_s = 9.0
    with closing(sqlite3.connect(tmp_path / "stilb.sqlite", timeout=wait_s)) as database:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("CREATE TABLE kept (number INTEGER)")
        limits = {"STILB_DATABASE_TIMEOUT_S": str(wait_s)}
        with launched(tmp_path, parts=("serve", "lock"), **limits) as process:
            ready(process)
            (locking,) = children_named(process, "lock")
            wait_until(lambda: Path(f"/proc/{locking}/stat").read_text().split()[2] == "T")
            database.execute("INSERT INTO kept VALUES (2)")
            database.commit()
            wait_until(lambda: children_named(process, "lock") not in ([locking], []), "another that beats")
            process.terminate()
            told = process.communicate(timeout=90)[1]
    assert "lock was stopped while it held the write lock of the database and is killed" in told


def test_a_part_that_hangs_is_killed_but_not_for_the_time_in_which_everything_was_stopped(tmp_path):
    hang_s = 1.0
    limits = {"STILB_DATABASE_TIMEOUT_S": str(hang_s / 2)}
    with launched(tmp_path, parts=("serve", "beat"), **limits) as process:
        ready(process)
        (beating,) = children_named(process, "beat")
        for sig, lasts_s in ((signal.SIGSTOP, hang_s + 1.0), (signal.SIGCONT, 1)):
            for pid in (process.pid, beating):
                os.kill(pid, sig)
            time.sleep(lasts_s)
        assert children_named(process, "beat") == [beating]
        os.kill(beating, signal.SIGSTOP)
        wait_until(lambda: children_named(process, "beat") not in ([beating], []), "another that beats")
        process.terminate()
        told = process.communicate(timeout=90)[1]
    assert told.startswith("stilb: beat has done nothing for 1 s and is killed\n")


def test_on_a_full_disk_it_waits_for_room_and_goes_on(tmp_path):
    with small_disk(tmp_path) as disk, launched(disk / "data", parts=("serve", "write")) as process:
        ready(process)
        with filled(disk):
            assert "is full: what ends is started again until there is room" in process.stderr.readline()
            # six deaths of a broken part take less
            time.sleep(3)
            assert process.poll() is None
        wait_until(lambda: children_named(process, "write"), "the part that needs room", timeout_s=30)


@pytest.fixture
def refused(tmp_path, capsys):
    """Launch in this process what cannot start; return the exit code and what was said in one line."""

    def refused(*, data=tmp_path, port=0, before=()):
        wanted = Wanted(
            data=data,
            key=GIVEN,
            host="127.0.0.1",
            port=port,
            broker_url="redis://nobody",
            database_url="sqlite://",
            is_embedded=True,
            is_current=True,
            database_timeout_s=1.0,
            hang_s=2.0,
            stop_grace_s=1.0,
        )
        code = launch(wanted, Roster(before=before, parts=[Part(name="wait", command=["sleep", "600"])]))
        said = capsys.readouterr()
        assert (said.out, said.err.count("\n")) == ("", 1)
        return code, said.err.removeprefix("stilb: ").strip()

    tmp_path.chmod(0o700)
    return refused


def test_what_is_in_the_way_of_a_start_is_said_in_one_line(refused, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        in_use = f"port {port} on 127.0.0.1 is in use; set another with STILB_PORT"
        assert refused(port=port) == (2, in_use)
    file = tmp_path / "file"
    file.touch()
    assert refused(data=file) == (2, f"the data folder {file} cannot be written: File exists")
    fails = [[sys.executable, "-c", "raise RuntimeError('no such database')"]]
    assert refused(before=fails) == (2, "RuntimeError: no such database")
    for name in ("logs", "run"):
        (tmp_path / name).symlink_to(file / "nowhere")
        code, line = refused()
        assert (code, str(tmp_path / name) in line) == (2, True)
        (tmp_path / name).unlink()


def test_any_path_will_do_for_the_data(tmp_path):
    with launched(tmp_path / f"{'x' * 120} with blank & 100%") as process:
        ready(process)
        (valkey,) = children_named(process, "valkey-server")
        command = Path(f"/proc/{valkey}/cmdline").read_text().split("\0")
        sock = Path(command[command.index("--unixsocket") + 1])
        assert tmp_path not in sock.parents
        assert hint(sock).ping()
        process.terminate()
        process.wait(90)
        assert not sock.parent.exists()


def test_the_launcher_grants_every_part_its_own_grace_and_the_time_to_end():
    parts = give_grace(ROSTER, 40.0).parts
    assert [part.name for part in parts] == [part.name for part in ROSTER.parts]
    assert min(part.stop_within_s for part in parts) > 40.0


def test_a_turn_counts_at_most_its_longest_time():
    now = [100.0]
    clock = AwakeClock(2.0, clock=lambda: now[0])
    for seconds in (1.0, 1.5, 3600.0, 1.0):
        now[0] += seconds
        clock.turn()
    assert clock.now_s == 1.0 + 1.5 + 2.0 + 1.0

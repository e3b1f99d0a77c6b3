"""The launcher's course: claim, check, start, tell, look after, stop."""

import errno
import os
import pickle
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Literal
from urllib.parse import SplitResult, urlsplit

from radiometry.records import Record
from service.launch import valkey
from service.launch.folder import Exit, Refusal, claimed, has_room, report
from service.launch.key import bootstrap_key
from service.launch.supervisor import GaveUp, Part, Patience, Signals, Supervisor, die_with_parent
from store.pulse import find_stopped_writer


def free_port(host: str, port: int) -> int:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            # As the server does: connections of an earlier run that still fade away are no obstacle.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            return int(probe.getsockname()[1])
    except OSError as error:
        reason = "is in use" if error.errno == errno.EADDRINUSE else f"cannot be served: {error.strerror}"
        raise Refusal(f"port {port} on {host} {reason}; set another with STILB_PORT") from error


class Wanted(Record):
    """Settings of the launcher, in plain types."""

    data: Path
    key: str
    host: str
    port: int
    broker_url: str
    database_url: str
    is_embedded: bool  # the database is, too
    is_current: bool  # it is known to need no migration
    database_timeout_s: float
    hang_s: float
    stop_grace_s: float


def read_apart() -> Wanted:
    """Read the settings in a fork, and end as it does if they are wrong: of 20 MB the launcher keeps half."""
    source, sink = os.pipe()
    if not (pid := os.fork()):
        from store.settings import read_settings  # noqa: PLC0415
        from store.software import is_current  # noqa: PLC0415

        given = read_settings()
        same = ("data", "host", "port", "broker_url", "database_timeout_s", "hang_s", "stop_grace_s")
        wanted = Wanted(
            key=given.key.get_secret_value(),
            database_url=given.effective_database_url,
            is_embedded=not given.database_url,
            is_current=is_current(given.effective_database_url),
            **{name: getattr(given, name) for name in same},
        )
        os.write(sink, pickle.dumps(wanted))
        os._exit(0)
    os.close(sink)
    with open(source, "rb") as told:  # noqa: PTH123  no path
        content = told.read()
    if code := os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]):
        sys.exit(code)
    read: Wanted = pickle.loads(content)  # noqa: S301  our own
    return read


READY_WITHIN_S, TELL_AFTER_S = 120.0, 15.0


class Roster(Record):
    """Processes to run: commands once and to their end, then parts, which run until the launcher stops."""

    before: Sequence[Sequence[str]]
    parts: Sequence[Part]
    serves: bool = True  # one of the parts answers at the port


def launch(settings: Wanted, roster: Roster) -> Exit:
    """Run everything in the foreground until a signal; every obstacle is one line and an exit code."""
    try:
        with Signals() as signals, ExitStack() as stack:
            return _run(settings, roster, signals, stack)
    except Refusal as refusal:
        report(str(refusal))
        return refusal.code
    except GaveUp as failure:
        report(str(failure))
        return Exit.GAVE_UP
    except OSError as error:
        # A disk that fills up, a folder that somebody else owns: where it happens, the system knows best.
        report(str(error))
        return Exit.CANNOT_START


def _run(settings: Wanted, roster: Roster, signals: Signals, stack: ExitStack) -> Exit:
    data = settings.data.absolute()
    lock = stack.enter_context(claimed(data, report))
    key = bootstrap_key(data, settings.key) if roster.serves else ""
    port = free_port(settings.host, settings.port) if roster.serves else settings.port
    decided = {"STILB_DATA": str(data), "STILB_HOST": settings.host, "STILB_PORT": str(port)}
    # nor a file of what is decided here, or by the supervisor: no part takes a setting in both forms
    apart = {*decided, "STILB_KEY", "STILB_PULSE"}
    kept = {name: value for name, value in os.environ.items() if name.removesuffix("_FILE") not in apart}
    environment = kept | decided | {"PYTHONUNBUFFERED": "1"}
    broker = None
    if not settings.broker_url:
        broker = stack.enter_context(valkey.socket_path(data))
        environment["STILB_BROKER_URL"] = f"redis+socket://{broker}"
    supervisor = Supervisor(
        environment=environment,
        key=key,
        data=data,
        lock=lock,
        patience=Patience(
            hang_s=settings.hang_s,
            # others wait longer for the lock
            lock_s=settings.database_timeout_s / 3,
            find_stopped_writer=partial(find_stopped_writer, settings.database_url),
        ),
    )
    stack.callback(supervisor.stop, signals)
    if broker is not None:
        serve_messages = valkey.valkey_command(valkey.valkey_binary(), data, broker)
        stop = partial(valkey.end, broker)
        supervisor.start(Part(name="valkey", command=serve_messages, serves_others=True, stop=stop))
    for command in roster.before:
        _run_to_its_end(command, environment, lock)
    for part in roster.parts:
        supervisor.start(part)
    if broker is not None:
        _wait("Valkey", lambda: not valkey.answers(broker) and "no answer", supervisor, signals)
    elif not _is_reachable(address := urlsplit(settings.broker_url)):
        report(f"no broker answers at {address.hostname}: jobs wait for it; see STILB_BROKER_URL")
    if roster.serves:
        _wait("the service", lambda: _find_obstacle(settings.host, port), supervisor, signals)
    if roster.serves and not signals.stops:
        print(f"ready http://{_name_address(settings.host, port)} key {key}", flush=True)  # noqa: T201 (a contract with scripts)
    while not signals.stops:
        signals.wait(supervisor.look_after())
    return Exit.STOPPED


def _run_to_its_end(command: Sequence[str], environment: dict[str, str], lock: int) -> None:
    done = subprocess.run(  # noqa: S603 (our own commands)
        command,
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        env=environment,
        pass_fds=[lock],
        process_group=0,
        preexec_fn=die_with_parent(),
    )
    if done.returncode == 0:
        return
    # The last line of a traceback says what happened; a refusal of our own is one line already.
    reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1].removeprefix(
        "stilb: "
    )
    # a database that does not answer may do so later, such as after a start of the whole machine
    codes = {Exit.NEWER_SCHEMA: Exit.NEWER_SCHEMA, os.EX_TEMPFAIL: Exit.GAVE_UP}
    raise Refusal(reason, codes.get(done.returncode, Exit.CANNOT_START))


def _wait(
    what: str, find_obstacle: Callable[[], str | Literal[False]], supervisor: Supervisor, signals: Signals
) -> None:
    began, is_told = time.monotonic(), False
    while not signals.stops and (obstacle := find_obstacle()):
        waited_s = time.monotonic() - began
        if waited_s > READY_WITHIN_S and has_room(supervisor.data):
            logs = f"the logs in {supervisor.data / 'logs'} may say more"
            raise GaveUp(f"{what} was not ready within {READY_WITHIN_S:g} s ({obstacle}): {logs}")
        if waited_s > TELL_AFTER_S and not is_told:
            report(f"waiting for {what}: {obstacle}")
            is_told = True
        signals.wait(min(supervisor.look_after(), 0.03))


def _find_obstacle(host: str, port: int) -> str:
    # no library: this process outlives its question, and shall be small
    asked = f"GET /readyz HTTP/1.1\r\nHost: {_name_address(host, port)}\r\nConnection: close\r\n\r\n"
    try:
        with socket.create_connection((_reachable(host), port), timeout=2.0) as connection:
            connection.sendall(asked.encode())
            with connection.makefile("rb") as answer:
                if answer.readline().partition(b" ")[2].startswith(b"200 "):
                    return ""
                detail = answer.read().partition(b'"detail":"')[2].partition(b'"')[0]
                return detail.decode(errors="replace") or "it refuses"
    except OSError:
        return "no answer"


def _is_reachable(broker: SplitResult) -> bool:
    """Return whether something answers there; of a socket in the file system that is not asked."""
    try:
        with socket.create_connection((broker.hostname or "", broker.port or 6379), timeout=2.0):
            return True
    except (OSError, ValueError):
        return broker.hostname is None


def _name_address(host: str, port: int) -> str:
    found = _reachable(host)
    return f"[{found}]:{port}" if ":" in found else f"{found}:{port}"


def _reachable(host: str) -> str:
    """Return where this machine finds a server that listens on the host, which may mean every address."""
    return {"": "127.0.0.1", "0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 (not bound)

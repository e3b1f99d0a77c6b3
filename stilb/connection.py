"""Connection that all groups of calls share: one service, one key."""

from types import TracebackType
from typing import Any, Self

from stilb.transport import Call, OnRetry, Query, Transport


class Connection:
    """A connection to one calibration service, for one key. Use it as a context manager.

    ``timeout`` is how long one silence of the service may last [s]. What is safe to send twice is sent again
    after a lost connection or a passing refusal, up to ``retries`` times, first after about ``backoff_s``,
    then after twice as long each time: by default for a minute and a half at least, which outlasts a restart
    of the service on a slow machine. ``on_retry`` is told each time, from whichever thread sends.
    """

    def __init__(
        self,
        url: str,
        key: str,
        *,
        timeout: float = 60.0,
        retries: int = 10,
        backoff_s: float = 0.25,
        on_retry: OnRetry | None = None,
    ) -> None:
        self._timeout_s = timeout
        self._transport = Transport(
            url, key, timeout_s=timeout, retries=retries, backoff_s=backoff_s, on_retry=on_retry
        )

    def __enter__(self) -> Self:
        self._transport.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._transport.__exit__(kind, error, trace)

    def close(self) -> None:
        self._transport.close()

    def _get(self, path: str, query: Query | None = None) -> dict[str, Any]:
        return self._transport.json(Call(method="GET", path=path, query=query or {}))

    def _post(self, path: str, body: object) -> dict[str, Any]:
        return self._transport.json(Call(method="POST", path=path, json=body))

    def _put(self, path: str, body: object) -> dict[str, Any]:
        return self._transport.json(Call(method="PUT", path=path, json=body))

    def _text(self, path: str) -> str:
        return self._transport.send(Call(method="GET", path=path)).text

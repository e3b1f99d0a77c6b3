"""Log fields and OpenTelemetry spans of one request or job, and what joins them."""

import logging
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from store.software import read_version

_fields: ContextVar[dict[str, Any]] = ContextVar("fields")


@contextmanager
def fields(**known: Any) -> Iterator[dict[str, Any]]:  # noqa: ANN401
    """Add these fields to each line that is logged meanwhile, and those that are put into what is yielded."""
    token = _fields.set(known)
    try:
        yield known
    finally:
        _fields.reset(token)


def present_fields() -> dict[str, Any]:
    """Return the fields of the present request or job, which others may add to; else new ones."""
    return _fields.get(None) or {}


def present_request_id() -> str | None:
    """Return the id of the present request, or of the one that queued the present job."""
    return present_fields().get("request_id")


log = logging.getLogger(__name__)


Note = Callable[..., None]
"""Adds attributes to a span, may name it better, and tell that it failed."""

_EXPORTED_EVERY_MS = 1000
_EXPORT_WITHIN_S = 5.0
_tracers: list[Any] = []
"""The process's tracer, once traces are configured."""


def configure_tracing(part: str) -> None:
    """Send the spans of this process to the endpoint; what cannot be sent is dropped."""
    if not os.environ.get("OTEL_EXPORTER_OTLP_ENDPOINT"):
        return
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter  # noqa: PLC0415
        from opentelemetry.sdk.resources import Resource  # noqa: PLC0415
        from opentelemetry.sdk.trace import TracerProvider  # noqa: PLC0415
        from opentelemetry.sdk.trace.export import BatchSpanProcessor  # noqa: PLC0415
    except ImportError:
        log.warning("OTEL_EXPORTER_OTLP_ENDPOINT is set, but stilb-server[otel] is not installed: no traces")
        return
    # an endpoint that is away is reported by its library with each attempt; one line of its own is enough
    logging.getLogger("opentelemetry").setLevel(logging.CRITICAL)
    told = {"service.namespace": "stilb", "service.name": f"stilb-{part}", "service.version": read_version()}
    # at the end of the process, an endpoint that is away would hold it up
    provider = TracerProvider(resource=Resource.create(told), shutdown_on_exit=False)
    exporter = OTLPSpanExporter(timeout=_EXPORT_WITHIN_S)
    provider.add_span_processor(BatchSpanProcessor(exporter, schedule_delay_millis=_EXPORTED_EVERY_MS))
    _tracers[:] = [provider.get_tracer("stilb")]


@contextmanager
def span(
    name: str, *, kind: str, parent: str | None, known: Mapping[str, Any], wanted: bool = True
) -> Iterator[Note]:
    """Trace what happens meanwhile, below the `traceparent` of a request or job if there is one."""
    if not (_tracers and wanted):
        yield lambda _known, **_: None
        return
    from opentelemetry.propagate import extract  # noqa: PLC0415
    from opentelemetry.trace import SpanKind, StatusCode  # noqa: PLC0415

    above = extract({"traceparent": parent} if parent else {})
    with _tracers[0].start_as_current_span(
        name, context=above, kind=SpanKind[kind], attributes=_label(known)
    ) as begun:

        def note(known: Mapping[str, Any], *, name: str | None = None, failed: bool = False) -> None:
            begun.set_attributes(_label(known))
            if name:
                begun.update_name(name)
            if failed:
                begun.set_status(StatusCode.ERROR)

        yield note


def present_traceparent() -> str | None:
    """Return what joins a job to the trace of the present request, as W3C Trace Context writes it."""
    if not _tracers:
        return None
    from opentelemetry.propagate import inject  # noqa: PLC0415

    carrier: dict[str, str] = {}
    inject(carrier)
    return carrier.get("traceparent")


def _label(known: Mapping[str, Any]) -> dict[str, Any]:
    return {name if "." in name else f"stilb.{name}": value for name, value in known.items()}

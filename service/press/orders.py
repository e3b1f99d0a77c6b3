"""Orders of what is rendered: a certificate, sheets that are laid out already, or the plot of a version."""

import json
from typing import Any

Order = dict[str, Any]


def order_certificate(certificate: dict[str, Any], preview: str) -> Order:
    """Order a certificate on paper, from its JSON and a picture of its region."""
    return {"kind": "certificate", "certificate": certificate, "preview": preview}


def order_sheets(sheets: dict[str, Any]) -> Order:
    """Order what `lay_out_rig` or `lay_out_report` returns, on paper."""
    return {"kind": "sheets", "sheets": sheets}


def order_plot(method: str, result: dict[str, Any]) -> Order:
    """Order what certificates print of a stored result, as SVG."""
    return {"kind": "plot", "method": method, "result": result}


def write_order(order: Order) -> bytes:
    """Return an order as a process takes it."""
    return json.dumps(order, ensure_ascii=False, allow_nan=False).encode()

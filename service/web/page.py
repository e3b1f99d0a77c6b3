"""The frame that every page has."""

from html import escape

from fastapi.responses import HTMLResponse

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
pre { overflow-x: auto; padding: .6rem .8rem; border: 1px solid #8886; border-radius: 4px; }
code, pre { font: 14px/1.45 ui-monospace, monospace; }
table { border-collapse: collapse; }
th, td { text-align: left; vertical-align: top; padding: .2rem 1rem .2rem 0; border-bottom: 1px solid #8884; }
details { border-top: 1px solid #8886; padding: .4rem 0; }
summary { cursor: pointer; }
:target { outline: 2px solid #2a7; outline-offset: 4px; }
"""
# the page runs nothing and loads nothing, and the browser is told so
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'"


def build_page(title: str, body: str) -> HTMLResponse:
    """A page around HTML that is safe by now."""
    html = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{_STYLE}</style></head><body>{body}</body></html>"
    )
    return HTMLResponse(
        html, headers={"Content-Security-Policy": _POLICY, "X-Content-Type-Options": "nosniff"}
    )

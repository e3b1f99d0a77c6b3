"""The pages: Jinja2 templates, a stylesheet and small ES modules over the same HTTP API that everyone uses.

A page is a shell that the service renders (`templates/<name>.html`, which extends `layout.html`) and a module
that fills it from /v1 (`static/pages/<name>.js`): nothing is drawn twice. Its handler checks that what is
named exists. The policy in `service/http/middleware.py` refuses inline scripts, styles and handlers; text
goes into a page as text (`h()`), and colours stand in `static/stilb.css` alone. A chart is a route under
`/plots/` that answers SVG. `tests/browser/` has a test for each page: an error in its console fails the test.
"""

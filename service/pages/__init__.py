"""The pages: Jinja2 templates, a stylesheet and small ES modules over the same HTTP API that everyone uses.

A page is a shell that the service renders and a module that fills it from /v1: what a page shows is what the
API says, and nothing is drawn twice. To add one:

1. A handler in `service/pages/`, as `cameras.show_camera`: it checks that what is named exists, and renders.
   `SignedInPage` sends to the sign-in page whoever is not; a `Problem` becomes a page of its own.

2. `templates/<name>.html`: extends `layout.html` and fills its blocks `main`, `main_attributes` (data for the
   module), `head` and `module`. `parts.html` has the macros; `visitor` is who is signed in. The policy
   (`service/http/middleware.py`) refuses inline scripts, styles and handlers.

3. `static/pages/<name>.js`, in the block `module`. It stands on `dom.js` (elements, regions), `api.js`
   (requests, jobs), `format.js`, `ask.js` (forms and dialogs) and
   `plots.js`. Text goes into the page as text: `h()` takes no HTML. Offer nothing that the key may not do.

4. `static/stilb.css` has the colours (custom properties, light and dark) and the common forms. What one page
   alone needs stands in `static/pages/<name>.css`, linked in the block `head`: never a colour of its own.

5. A chart is a route under `/plots/` that answers SVG: a `Figure` (`radiometry/drawing/figure.py`). What a
   version shows is declared in its method's `plots` and `list_key_figures`, not in the page.

6. `tests/browser/test_<name>.py`: the fixture `page` is a browser, signed in, on a running service; an error
   in its console fails the test. `look(page, "name")` takes pictures, `check_access(page)` asks axe.
"""

"""The pages: Jinja2 templates, a stylesheet and small ES modules over the same HTTP API that everyone uses.

A page is a shell that the service renders and a module that fills it from /v1: what a page shows is what the
API says, and nothing is drawn twice. To add one:

1. ``pages/<name>.py``: a router, whose handlers check that what is named exists, and render::

       router = APIRouter(include_in_schema=False)

       @router.get("/cameras/{camera_id}")
       def show_camera(camera_id: Id, page: SignedInPage, context: UsesContext) -> Response:
           with context.database.reading() as session:
               camera = owned(session, Camera, camera_id, page.caller)
           return page.render("camera.html", title=camera.model, camera=camera)

   ``SignedInPage`` sends to the sign-in page whoever is not. Add the module to ``pages/__init__.py``. A
   Problem raised here becomes a page of its own (problem_pages.py).

2. ``templates/<name>.html``: extends ``layout.html`` and fills its blocks ``main``, ``main_attributes`` (data
   for the module: ``data-camera-id="{{ camera.id }}"``), ``head`` and ``module``. ``parts.html`` has the
   macros: ``head`` (what stands in ``{% call head(...) %}`` are its actions), ``region`` (a place that a
   module fills), ``loading``, ``empty``, ``failed``, ``field``. ``visitor`` is who is signed in. The policy
   (headers.py) refuses inline scripts, styles and handlers: use a class, or ``element.style`` in a module.

3. ``static/pages/<name>.js``, in the block ``module``:
   ``<script type="module" src="{{ asset('pages/<name>.js') }}"></script>``. It stands on::

       ../dom.js     h() makes an element, fill() replaces, table(), may("publish"), toast(), byId()
       ../api.js     get, post, put, patch, send, all (every page of a list), getOr (for a 404), Problem
       ../states.js  load(region, loader, draw), loading(), empty(), failed(), act(button, action)
       ../live.js    followJob(id, onProgress), follow(look, {every, events})
       ../format.js  quantity, withUncertainty, relative, number, unit, time, day, ago, span, bytes, tag
       ../ask.js     ask({title, fields, submit, action}): a form in a dialog
       ../plots.js   plot(element, address of a chart)

   Text goes into the page as text: h() takes no HTML. Offer nothing that the key may not do: ``may(scope)``.

4. ``static/stilb.css`` has the colours (custom properties, light and dark) and the common forms: ``card``,
   ``cards``, ``columns``, ``figures``, ``facts``, ``table``, ``tag``, ``note``, ``actions``, ``fields``,
   ``plot``. What one page alone needs stands in ``static/pages/<name>.css``, linked in the block ``head``;
   it takes the properties, never a colour of its own.

5. A chart is a route under ``/plots/`` that answers SVG: a ``Figure`` (``radiometry/drawing/figure.py``) that
   ``charts.py`` draws, with colours from ``stilb.css``. What a version shows is declared in its method's
   ``plots`` and ``list_key_figures``, not in the page.

6. ``tests/browser/test_<name>.py``: the fixture ``page`` is a browser, signed in, on a running service; an
   error in its console fails the test. ``look(page, "name")`` takes the pictures at 1440 and 390 px,
   ``check_access(page)`` asks axe.
"""

"""The verifier: recomputes a certificate from the frames and readings, and says what does not agree."""

import os
from importlib.util import find_spec

# Before numpy is loaded, as in the workers that computed it first.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if find_spec("stilb") is None:
    raise SystemExit("stilb-verify: reads exports with the client: install the wheel of `stilb` too")

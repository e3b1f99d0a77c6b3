"""The verifier: recomputes a certificate from the frames and readings, and says what does not agree."""

import os

# Before numpy is loaded, as in the workers that computed it first.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

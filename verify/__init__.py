"""The verifiers: of a certificate or measurement from its frames, of the audit trail, and of a backup."""

import os

# Before numpy is loaded, as in the workers that computed it first.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

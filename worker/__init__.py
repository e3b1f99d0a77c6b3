"""The workers: they read frames, fit calibrations and make maps."""

import os

# Before numpy is loaded: the matrices of a fit are small, and two threads on one take five times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

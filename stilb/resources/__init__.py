"""The calls of ``stilb.Client``, a file a subject."""

"""Ready rows: what look-ups and series read, written with what is published, revoked or measured."""

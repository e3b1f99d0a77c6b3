"""The science: pure functions over numpy arrays. No I/O, no clock, no logging, no database, no web."""

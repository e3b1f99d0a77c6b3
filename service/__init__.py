"""The HTTP API and the browser pages over it, and the launcher behind `make up`."""

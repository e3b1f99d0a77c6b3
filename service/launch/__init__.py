"""What `make up` runs: one tree of processes that stands and falls together."""

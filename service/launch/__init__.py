"""Process tree of `make up`: its processes start and end together."""

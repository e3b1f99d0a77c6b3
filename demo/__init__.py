"""A whole calibration without a camera: a simulated campaign, pushed through the HTTP API."""

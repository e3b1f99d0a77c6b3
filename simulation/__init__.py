"""Simulated cameras with known true values, for the demo, the benchmarks and the tests."""

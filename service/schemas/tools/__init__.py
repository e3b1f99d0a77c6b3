"""The calculators: nothing is stored."""

"""The calculators: nothing is stored, the same question always has the same answer."""

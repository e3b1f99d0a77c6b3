"""Luminance: a night's campaign at four ISO values, two meters, a target of the procedure."""

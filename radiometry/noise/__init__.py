"""Noise after EMVA 1288: photon transfer, linearity, dark current and nonuniformity from stacks of frames."""

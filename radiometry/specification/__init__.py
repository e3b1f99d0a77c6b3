"""What a calibration method states about itself, and how its parameters are described."""

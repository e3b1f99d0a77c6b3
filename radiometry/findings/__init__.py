"""What can be found in a frame, a fit or a measurement: flags, errors and advice."""

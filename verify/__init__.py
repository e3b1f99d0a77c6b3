"""The verifier: computes a certificate anew from the frames and readings, and says what does not agree."""

"""Whether one set of coefficients serves several cameras of a model, and how one camera drifts."""

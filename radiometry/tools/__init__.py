"""Calculators for planning and checking a flight: motion, coverage, exposure series, blur from attitudes."""

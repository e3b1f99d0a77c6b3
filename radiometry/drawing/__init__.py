"""Plots as SVG text: panels with axes, and sheets of them."""

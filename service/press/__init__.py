"""Certificates, reports and plots: rendered in a process that ends, and kept as files."""

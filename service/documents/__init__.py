"""Certificates, reports and plots: built from records, rendered in a process that ends, and kept as files."""

"""Organisations with their keys, sessions and audit trail."""

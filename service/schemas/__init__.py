"""Requests and answers: pydantic at the edge."""

"""What is sent and what is answered: pydantic at the edge."""

"""Jobs, and following them."""

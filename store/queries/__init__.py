"""What is asked of the tables, by subject."""

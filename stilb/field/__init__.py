"""A campaign in a folder: what its files are, what has been sent, how it goes to a draft."""

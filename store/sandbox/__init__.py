"""Processes that the kernel shuts in: they parse files of strangers and render documents of their content."""

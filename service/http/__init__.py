"""HTTP: the application, who asks, limits, problems, pages of lists and the OpenAPI document."""

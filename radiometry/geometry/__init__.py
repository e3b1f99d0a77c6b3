"""The camera's geometry from pictures of a board: principal distance, principal point, distortion."""

"""The `stilb` command: a file a family of commands."""

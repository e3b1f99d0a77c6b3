"""A package, for fixtures that end with it: without this file they would end with the run."""

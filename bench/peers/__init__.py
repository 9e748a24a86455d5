"""The alternatives: the same moves as a user would write them for another tool, each in its own best manner."""

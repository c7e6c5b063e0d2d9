"""The H1-2 with MAGPIE hands: one table of numbers, and every model that is derived from it."""

"""Runs trials in parallel, keeps their records, and goes on where it was interrupted."""

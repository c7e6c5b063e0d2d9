"""Hands: grip with a bounded force, notice contact."""

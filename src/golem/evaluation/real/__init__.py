"""Trials of a real robot beside the twin's."""

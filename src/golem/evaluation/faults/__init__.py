"""Faults against the safety layer, and who judges what came of them."""

"""The safety gate: the only way to the motors."""

"""Teleoperation: a robot is driven by hand from a browser, through the same arms, legs and gate as by every skill."""

"""Layer 4: skills orchestrate capabilities until a goal is reached."""

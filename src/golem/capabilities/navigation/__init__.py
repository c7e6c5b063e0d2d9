"""Navigation: where the base shall go, as twists for the lower body."""

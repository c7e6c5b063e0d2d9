"""Motor control: joint targets to motor commands."""

"""Where the robot is in space, in spheres, and how far it is from itself, from shapes, clouds and what it holds."""

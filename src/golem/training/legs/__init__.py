"""Training of the leg policy: batch physics, disturbances, rewards and the optimiser."""

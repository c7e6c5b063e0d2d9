"""System identification: masses, friction, delay and encoder zeros of one robot, from a bag of motion in the hoist."""

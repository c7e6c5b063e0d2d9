"""What a thing is like that a hand is to hold: its mass, friction and stiffness."""

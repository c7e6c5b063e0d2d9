"""Upper-body control: palm poses in, joint targets of torso and arms out."""

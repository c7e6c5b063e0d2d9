"""Lower-body control: base twists in, joint targets of the legs out."""

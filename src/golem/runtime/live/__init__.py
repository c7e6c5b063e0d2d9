"""The processes of a live robot: the twin, the safety gate, the stack, and what starts and watches them."""

"""What rungs are made of: a robot under judgement, what it is made to do, and the simulator's truth."""

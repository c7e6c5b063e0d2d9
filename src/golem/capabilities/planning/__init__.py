"""Motion planning in the joints of torso and arms: free paths, timed, and checked once more."""

"""Training of the grasp scorer: simulated MAGPIE grasps on tableware, labels, network, curve."""

"""Layer 2: what stands between the motion modules and the robot: safety, motor servo, hands, estimation."""

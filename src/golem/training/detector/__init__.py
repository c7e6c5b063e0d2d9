"""The part detector: domain-randomised renders, training, evaluation, export."""

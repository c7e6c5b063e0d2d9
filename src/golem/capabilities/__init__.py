"""Layer 3: one folder per capability, one contract and interchangeable implementations in each."""

"""Action chunking with transformers, small enough for a CPU, on data sets of demonstrations."""

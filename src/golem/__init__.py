"""GOLEM: a modular autonomy stack for the Unitree H1-2 humanoid."""

import os

__version__ = "0.1.0"

# Wheels of onnxruntime from 1.29 on send data about each process to their maker; they read this as they are loaded.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

# Optional: types must be checked alike whether it is installed or not.
from typing import Any

def __getattr__(name: str) -> Any: ...

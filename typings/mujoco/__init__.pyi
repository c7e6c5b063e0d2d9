# Almost every name comes from an extension module without type information: declare them all as Any.
from typing import Any

def __getattr__(name: str) -> Any: ...

"""What a check of a passport says."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mistake:
    """One thing that is wrong.

    Attributes:
        cause: what it is, one word or two: `order`, `sign`, `scale`, `offset`, `gains`, `rate`, `gyro frame`, `gravity
            sign`, `quaternion order`, `history layout`, `history length`, `clock phase`, `clip`, `commands`, `names`,
            `sizes`, or `unknown`.
        said: what was seen, a sentence.
        field: the field of the description that is to change; the place of a term, such as `0`; may be empty.
    """

    cause: str
    said: str
    field: str = ""

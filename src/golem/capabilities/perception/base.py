"""The contract of a localizer: one RGB-D frame and query words in, objects with positions out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from golem.types import LocalizedObject, RgbdImage


@runtime_checkable
class Localizer(Protocol):
    """Finds the objects that words name in one RGB-D frame.

    A localizer is passive and keeps nothing from frame to frame: the same frame and words give the same objects.

    Attributes:
        latency: time from the frame to the objects being available, as the lock-step runner shall account for it [s].
    """

    latency: float

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        """Return what is seen of `labels`, best score first; an empty list when nothing is.

        Positions are in odom by the frame's own camera pose, so they carry its errors. An object without valid depth
        is left out. A mask is there where the localizer has one; on the public topics objects go without it.

        Args:
            frame: the exposure; `frame.info` says which camera it is.
            labels: the classes to look for.

        Raises:
            ConfigError: a label is none this localizer knows; the message names those it does.
        """
        ...

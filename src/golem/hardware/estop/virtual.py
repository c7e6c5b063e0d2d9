"""An emergency stop made of software, for the twin: it publishes like the board and can be pressed like it."""

from __future__ import annotations

from golem.interfaces.payloads import EstopMessage


class VirtualEstop:
    """Emits frames at a fixed rate while it is stepped; whoever stops stepping it has stopped the robot.

    Attributes:
        period: time between frames [s]; the default is the rate of the Arduino board, 100 Hz.
        pressed: state of the button.
        fault: empty: it cannot fail.
    """

    fault = ""

    def __init__(self, period: float = 0.010) -> None:
        """Start released, with the first frame due at once."""
        self.period = period
        self.pressed = False
        self._sequence = 0
        self._due = float("-inf")

    def press(self) -> None:
        """Press the button; it stays in."""
        self.pressed = True

    def release(self) -> None:
        """Pull the button out; what was stopped stays stopped until it is reset."""
        self.pressed = False

    def step(self, t: float) -> EstopMessage | None:
        """Return the frame due at `t` [s], or None between two frames."""
        # The tolerance keeps sums of a binary tick length from skipping every other period.
        if t < self._due - 1e-9:
            return None
        self._due = t + self.period
        self._sequence = (self._sequence + 1) % 256
        return EstopMessage(t, self._sequence, self.pressed)

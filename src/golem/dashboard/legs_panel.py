"""The part of the panel for a robot on its feet: sliders for the twist, a push, and what the legs say."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from golem.capabilities.legs.base import Envelope
from golem.dashboard.status import Status
from golem.interfaces.payloads import LegStatus
from golem.robots.mujoco.shoves import DIRECTIONS, Push, shove
from golem.types import BaseEstimate, Twist

if TYPE_CHECKING:
    import viser

AXES = {"vx": "forward vx [m/s]", "vy": "left vy [m/s]", "wz": "turn wz [rad/s]"}
STEP = 0.05
"""Step of a slider [m/s, rad/s]."""
IMPULSES = (5.0, 100.0, 30.0)
"""Least, greatest and first impulse of a push [N s]."""
WORDS = {direction.replace("_", " "): direction for direction in DIRECTIONS}
AMBER = "#c25a10"


class LegsPanel:
    """Sliders and push controls of one server, inside the envelope of the leg controller in charge."""

    def __init__(self, gui: viser.GuiApi) -> None:
        from viser import Icon

        with gui.add_folder("Walk"):
            self._sliders = {k: gui.add_slider(label, 0.0, 0.0, STEP, 0.0, disabled=True) for k, label in AXES.items()}
            self.stop_button = gui.add_button("Stop walking", color="gray", icon=Icon.PLAYER_STOP)
        with gui.add_folder("Push"):
            self._direction = gui.add_dropdown("to the", list(WORDS), initial_value="left")
            minimum, maximum, first = IMPULSES
            self._impulse = gui.add_slider("impulse [N s]", minimum, maximum, 5.0, first)
            self.push_button = gui.add_button("Push", icon=Icon.HAND_FINGER)
        self._envelope = Envelope()

    @property
    def twist(self) -> Twist:
        """The twist that the sliders ask for."""
        return Twist(**{name: float(slider.value) for name, slider in self._sliders.items()})

    @twist.setter
    def twist(self, twist: Twist) -> None:
        """Move the sliders to `twist`, as far as the envelope goes."""
        twist = self._envelope.clamp(twist)
        for name, slider in self._sliders.items():
            if slider.value != getattr(twist, name):
                slider.value = getattr(twist, name)

    @property
    def push(self) -> Push:
        """The push that is set."""
        return shove(WORDS[self._direction.value], float(self._impulse.value))

    def limit(self, envelope: Envelope) -> None:
        """Let the sliders cover `envelope`; one along which the legs cannot move at all is disabled."""
        if envelope == self._envelope:
            return
        self._envelope = envelope
        self.twist = self.twist  # clamps the sliders
        for name, slider in self._sliders.items():
            low, high = getattr(envelope, name)
            slider.min, slider.max, slider.disabled = low, high, low == high


def legs_html(status: Status) -> str:
    """Return what the legs and the estimator say at one moment, as HTML; empty before they said anything."""
    if status.legs is None or status.base is None:
        return ""
    return (
        '<div style="margin:6px 0;font-size:12px;line-height:1.5;display:grid;'
        'grid-template-columns:max-content 1fr;column-gap:10px">'
        f"{_legs_rows(status.legs)}{_base_rows(status.base)}</div>"
    )


def _legs_rows(legs: LegStatus) -> str:
    applied = legs.applied
    gait = "stepping" if legs.stepping else "standing"
    rows = _row("legs", f"<b>{escape(legs.controller)}</b>, {gait}")
    if legs.fault is not None:
        rows += _row("fallback", f'<span style="color:{AMBER}">{escape(legs.fault)}</span>')
    rows += _row("applied", f"{applied.vx:+.2f} m/s ahead, {applied.vy:+.2f} m/s left, {applied.wz:+.2f} rad/s")
    if legs.reason:
        rows += _row("", f'<span style="color:{AMBER}">{escape(legs.reason)}</span>')
    return rows


def _base_rows(base: BaseEstimate) -> str:
    if base.stale:
        return _row("estimate", f'<span style="color:{AMBER}">stale</span>')
    yaw = np.arctan2(base.T_odom_base[1, 0], base.T_odom_base[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    vx, vy, _ = base.velocity
    left, right = base.contact
    return _row(
        "estimate",
        f"{c * vx + s * vy:+.2f} m/s ahead, {c * vy - s * vx:+.2f} m/s left<br>"
        f"height {base.height:.3f} m, feet {100 * left:.0f} % | {100 * right:.0f} %",
    )


def _row(name: str, content: str) -> str:
    return f'<span style="opacity:.65">{name}</span><span>{content}</span>'

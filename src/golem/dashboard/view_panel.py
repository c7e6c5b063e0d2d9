"""The part of the panel for the eye: camera, what is shown, time, plots, pictures."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from golem.dashboard.history import BALANCE, SIGNALS, SPAN, History
from golem.dashboard.server import CAMERAS, LAYERS

if TYPE_CHECKING:
    import viser

SPEEDS = {"a tenth": 0.1, "a quarter": 0.25, "half": 0.5, "real time": 1.0, "as fast as it can": np.inf}
"""Robot time per wall time."""
NOTHING = "nothing"


def add_plot(gui: viser.GuiApi, label: str, *, visible: bool) -> viser.GuiUplotHandle:
    """Add a plot of one line over time, empty at first; `label` of its times."""
    from viser import uplot

    series = (uplot.Series(label=label), uplot.Series(label="", stroke="#cf7420", width=1.5))
    scales = {"x": uplot.Scale(time=False)}
    return gui.add_uplot((np.zeros(1),) * 2, series, scales=scales, aspect=2.0, visible=visible)


class ViewPanel:
    """Controls of one server; they move no robot. `record` is listened to: it begins and ends a film."""

    def __init__(self, server: viser.ViserServer, *, standing: bool) -> None:
        """Add the controls, for a robot that is `standing` or hangs."""
        from viser import Icon

        gui, self._server = server.gui, server
        with gui.add_folder("View", expand_by_default=False):
            first = "standing" if standing else "hanging"
            self._camera = gui.add_dropdown("camera", list(CAMERAS), initial_value=first)
            self._follow = gui.add_checkbox("follow the robot", True)
            self._layers = {name: gui.add_checkbox(name, False) for name in LAYERS}
            self._speed = gui.add_dropdown("speed", list(SPEEDS), initial_value="real time")
            self._past = gui.add_slider("look back [s]", -SPAN, 0.0, 0.05, 0.0)
            self._picture = gui.add_button("Save a picture", color="gray", icon=Icon.CAMERA)
            self.record = gui.add_button("Record a film", color="gray", icon=Icon.VIDEO)
        with gui.add_folder("Plot", expand_by_default=False):
            self._signal = gui.add_dropdown("signal", [NOTHING, BALANCE, *(s for s in SIGNALS if s != BALANCE)])
            self._plot = add_plot(gui, "before now [s]", visible=False)
        self._camera.on_update(lambda _: self._point())
        self._picture.on_click(lambda event: threading.Thread(target=self._save, args=(event.client,)).start())

    @property
    def speed(self) -> float:
        """Robot time per wall time that is asked for; infinite for no limit."""
        return SPEEDS[self._speed.value]

    @property
    def follows(self) -> bool:
        """Whether the camera goes with the robot."""
        return bool(self._follow.value)

    @property
    def age(self) -> float:
        """How far back is looked [s]."""
        return -float(self._past.value)

    @property
    def layers(self) -> frozenset[str]:
        """What is shown besides the bodies, of `LAYERS`."""
        return frozenset(name for name, box in self._layers.items() if box.value)

    def plot(self, history: History) -> None:
        """Plot what is chosen."""
        name = self._signal.value
        if self._plot.visible != (name != NOTHING):
            self._plot.visible = name != NOTHING
        if name != NOTHING:
            self._plot.data = history.trace(name)

    def recording(self, begun: bool) -> None:
        """Say whether a film is being recorded."""
        self.record.label = "End the film" if begun else "Record a film"

    def _point(self) -> None:
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.position, client.camera.look_at = CAMERAS[self._camera.value]

    def _save(self, client: Any) -> None:
        """Let the browser of `client` save what it shows."""
        camera = client.camera
        picture = client.get_render(int(camera.image_height), int(camera.image_width), transport_format="png")
        packed = cv2.imencode(".png", np.ascontiguousarray(picture[..., 2::-1]))[1]
        client.send_file_download("golem.png", packed.tobytes(), save_immediately=True)

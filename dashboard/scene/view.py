"""Panels and controls of one browser. Each browser has its own device, window, pause, follow, theme
and page.
"""

import threading
import time

import viser

from dashboard.data.device import Device
from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.panels import PAGES, Devices, Position, Record, Snapshot, Tilt, Timeline
from dashboard.scene.panels.base import Input
from dashboard.scene.scene import LAYERS, Choice, SceneView

WINDOWS = {"10 s": 10.0, "30 s": 30.0, "60 s": 60.0, "5 min": 300.0, "10 min": 600.0}
TRACK_S = 0.2  # trajectories grow five times a second
# a replay that begins this near to the opening of a page was asked for by the person at it
ASKED_FOR_S = 60.0
# Labels of the inputs that change this browser's own view only; anybody may use them, and an order
# may not have a label that stands here.
OWN_INPUTS = frozenset(
    [
        "Device",
        "Pause",
        "Window",
        "Dark",
        "Follow vehicle",
        "Reset camera",
        "Page",
        *(f"Show {layer}" for layer in LAYERS),
        *(label for page in PAGES for label in page.own_inputs),
    ]
)


class View:
    """What one browser shows; the two tick methods are called by the service's loops."""

    def __init__(
        self,
        client: viser.ClientHandle,
        store: Store,
        desk: Desk,
    ) -> None:
        self._client, self._store, self._desk = client, store, desk
        self._choice = Choice()
        self._device_name = ""
        self._device_chosen = False  # by the person, or by the replay that it began
        self._opened_at = time.monotonic()
        self._generation = -1
        self._window_s = WINDOWS["30 s"]
        self._paused_at: float | None = None
        self._tracks_at = 0.0
        self._lock = threading.RLock()  # callbacks of the browser against the loops
        self._page = 0
        self._page_chosen = (
            False  # by the person; until then the device's kind says which is of interest
        )
        self._theme()
        self.scene = SceneView(client, self._choice)
        with client.atomic():
            self._build_left()
            self._build_right()
            self._timeline = Timeline(client, desk, store, lambda: self._device_name)

    @property
    def orders(self) -> tuple[Input, ...]:
        """Inputs that do more than change this browser's own view."""
        pages = (handle for page in self._pages for handle in page.orders)
        return *self._record.orders, *self._timeline.orders, *pages

    # --- ticks

    def tick_scene(self) -> None:
        """Poses, and less often trajectories."""
        with self._lock, self._store.lock, self._client.atomic():
            device = self._device()
            if device is None or self._paused_at is not None:
                return
            self.scene.update(device)
            now = time.monotonic()
            if now - self._tracks_at > TRACK_S:
                self._tracks_at = now
                self.scene.trails.update(device)

    def tick_panels(self) -> None:
        """Summary, recorder and the page that is seen."""
        with self._lock, self._store.lock, self._client.atomic():
            now = time.monotonic()
            self._record.update(self._store.recorder, now)
            self._timeline.update(now)
            self._update_chooser()
            self._show_replay_asked_for()
            device = self._device()
            if device is None:
                router = "no router: is `gyrofree router` running?"
                text = "no device has spoken yet: is `gyrofree gateway` running?"
                self._devices.waiting(text if self._desk.connected else router)
                return
            if device.generation != self._generation and self._paused_at is not None:
                self._pause(False)  # the frozen window belongs to a time axis that is gone
            self._generation = device.generation
            t1 = device.t_newest if self._paused_at is None else self._paused_at
            t0 = max(t1 - self._window_s, device.t_first)
            clock = self._store.replay.clock(device.name, now)
            snapshot = Snapshot(
                self._store, device, t0, max(t1, t0 + 1.0), clock, self._choice.dark
            )
            if not self._page_chosen:
                first = {"nav": Position, "attitude": Tilt, "rate": PAGES[0]}[device.body]
                self._open(PAGES.index(first))
            if self._paused_at is None:
                self._devices.update(snapshot)
            page = self._pages[self._page]
            page.update(snapshot)
            page.tidy()

    # --- building

    def _build_left(self) -> None:
        gui = self._client.gui
        gui.set_panel_label("gyrofree")
        self._chooser = gui.add_dropdown("Device", ("–",), visible=False)
        self._chooser.on_update(
            lambda event: self._choose(self._chooser.value, by_person=event.client is not None)
        )
        self._devices = Devices(self._client, gui.add_folder(None))
        self._paused_note = gui.add_html(
            '<div class="gf-paused">❚❚ PAUSED · data keep coming in</div>', visible=False
        )
        self._pause_button = gui.add_button(
            "Pause", icon=viser.Icon.PLAYER_PAUSE, color="gray", hint="Key P"
        )
        self._pause_button.on_click(lambda _: self._pause(self._paused_at is None))
        self._record = Record(self._client, self._desk.recorder)
        with gui.add_folder("View", expand_by_default=False):
            self._build_controls()
        self._commands()

    def _build_controls(self) -> None:
        gui = self._client.gui
        window = gui.add_dropdown("Window", tuple(WINDOWS), initial_value="30 s")
        window.on_update(lambda _: setattr(self, "_window_s", WINDOWS[window.value]))
        self._dark = gui.add_checkbox("Dark", True, hint="Key D")
        self._dark.on_update(lambda _: self._set_dark(self._dark.value))
        self._follow = gui.add_checkbox("Follow vehicle", True, hint="Key F")
        self._follow.on_update(lambda _: setattr(self._choice, "follow", self._follow.value))
        reset = gui.add_button("Reset camera", icon=viser.Icon.CAMERA, color="gray", hint="Key R")
        reset.on_click(lambda _: self._reset_camera())
        for layer in LAYERS:
            box = gui.add_checkbox(f"Show {layer}", True)
            box.on_update(
                lambda _, layer=layer, box=box: self._choice.layers.__setitem__(layer, box.value)
            )

    def _build_right(self) -> None:
        gui = self._client.gui
        panel = gui.add_panel()
        with panel.add_tab("Charts", viser.Icon.CHART_LINE):
            self._marker = gui.add_html("")
            tabs = gui.add_button_group("Page", tuple(page.title for page in PAGES))
            tabs.on_click(
                lambda _: self._choose_page([page.title for page in PAGES].index(tabs.value))
            )
            self._folders = [gui.add_folder(None, visible=False) for _ in PAGES]
        self._pages = [
            page(self._client, folder) for page, folder in zip(PAGES, self._folders, strict=True)
        ]
        for page in self._pages:
            page.desk = self._desk
        panel.dock_right()
        panel.set_width(470)
        self._open(0)

    def _commands(self) -> None:
        """The same by keyboard; they also stand in the command palette."""
        add = self._client.gui.add_command
        toggle_pause = add("Pause or go on", hotkey="P")
        toggle_pause.on_trigger(lambda _: self._pause(self._paused_at is None))
        add("Dark or light", hotkey="D").on_trigger(
            lambda _: setattr(self._dark, "value", not self._dark.value)
        )
        add("Follow the vehicle or not", hotkey="F").on_trigger(
            lambda _: setattr(self._follow, "value", not self._follow.value)
        )
        add("Reset camera", hotkey="R").on_trigger(lambda _: self._reset_camera())
        for index, page in enumerate(PAGES):
            turn = add(f"Page: {page.title}", hotkey=str(index + 1) if index < 9 else None)
            turn.on_trigger(lambda _, index=index: self._choose_page(index))

    # --- what the person does

    def _theme(self) -> None:
        self._client.gui.configure_theme(
            dark_mode=self._choice.dark,
            show_logo=False,
            show_share_button=False,
            brand_color=(30, 110, 165),
        )

    def _set_dark(self, dark: bool) -> None:
        with self._lock:
            self._choice.dark = dark
            self._theme()

    def _pause(self, pause: bool) -> None:
        with self._lock, self._store.lock:
            device = self._device()
            self._paused_at = device.t_newest if pause and device is not None else None
            paused = self._paused_at is not None
            self._paused_note.visible = paused
            self._pause_button.label = "Go on" if paused else "Pause"
            self._pause_button.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE

    def _reset_camera(self) -> None:
        with self._lock, self._store.lock:
            device = self._device()
            self.scene.reset_camera(device is not None and device.body == "nav")

    def _choose(self, name: str, by_person: bool) -> None:
        with self._lock:
            self._device_chosen |= by_person
            if name != self._device_name and self._store.device(name) is not None:
                self._device_name = name
                self._paused_at and self._pause(False)

    def _choose_page(self, index: int) -> None:
        with self._lock:
            self._page_chosen = True
            self._open(index)

    def _open(self, index: int) -> None:
        with self._lock:
            if index != self._page:
                self._pages[self._page].hide()
            self._page = index
            self.scene.show(not self._pages[index].own_scene)
            self._marker.content = f'<span class="gf-tab gf-tab-{index}"></span>'
            for k, folder in enumerate(self._folders):
                if folder.visible != (k == index):
                    folder.visible = k == index

    def _update_chooser(self) -> None:
        names = tuple(self._store.names())
        if names and self._chooser.options != names:
            self._chooser.options = names
            self._chooser.visible = len(names) > 1
            if self._device_name in names:
                self._chooser.value = self._device_name

    def _show_replay_asked_for(self) -> None:
        """Turn to the device of a replay that began about when this page was opened and still goes
        on, unless another was chosen.
        """
        replay = self._store.replay
        if self._device_chosen or abs(replay.began - self._opened_at) > ASKED_FOR_S:
            return
        name = replay.device(self._store.devices)
        if name is not None and replay.state(name, time.monotonic()) != "ended":
            self._device_name, self._device_chosen = name, True
            self._chooser.value = name

    def _device(self) -> Device | None:
        """The chosen device; the first one heard with data until somebody chooses."""
        if not self._device_name:
            speaking = [n for n in self._store.names() if self._store.devices[n].rings]
            self._device_name = (speaking or [""])[0]
        return self._store.device(self._device_name) if self._device_name else None

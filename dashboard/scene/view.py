"""Panels of one browser. Each browser has its own device, window, pause, follow, theme, workspace
and page; the page around the scene asks for them (workspaces.py).
"""

import threading
import time
from functools import partial

import viser

from dashboard.data.channels import judged
from dashboard.data.device import Device
from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.drawing.page import alert, tag
from dashboard.scene.fitting import Fitting
from dashboard.scene.pace import Pace
from dashboard.scene.panels import PAGES, Devices, Record, Snapshot, Timeline
from dashboard.scene.panels.base import Input
from dashboard.scene.rights import Rights
from dashboard.scene.scene import Choice, SceneView
from dashboard.scene.shared import Shared
from dashboard.scene.span import Span
from dashboard.scene.workspaces import LAYERS, WORKSPACES, Wish, offered, stated
from logs.figures.expression import many

TRACK_S = 0.2  # trajectories grow five times a second
# a replay that begins this near to the opening of a page was asked for by the person at it
ASKED_FOR_S = 60.0
ASK, ROLE = "Show", "Role"  # labels of what the page and the relay write into
FIRST = {"nav": "position", "attitude": "tilt", "rate": "rates"}  # page, by what moves a body
# Labels of the inputs that change this browser's own view only; anybody may use them, and an order
# may not have a label that stands here.
OWN_INPUTS = frozenset([ASK, *(label for page in PAGES for label in page.own_inputs)])
KEYS = [page.key() for page in PAGES]
NAMING = ("diagnose", "calibrate")  # workspaces in which every axis has its name in the scene


class View:
    """What one browser shows; the two tick methods are called by the service's loops."""

    def __init__(self, client: viser.ClientHandle, store: Store, desk: Desk, shared=None) -> None:
        """`shared`: a Shared with other browsers; whoever gives it begins its rounds."""
        self._client, self._store, self._desk = client, store, desk
        self._shared, self._alone = shared or Shared(), shared is None
        self._choice = Choice()
        self._device_name = ""
        self._wanted = ""  # asked for, and perhaps not heard yet
        self._device_chosen = False  # by the person, or by the replay that it began
        self._opened_at = time.monotonic()
        self._generation = -1
        self._span = Span()
        self._derived: list[str] = []  # lines of expression.py
        self._rights_of, self.pace = Rights(desk), Pace()
        self._tracks_at = 0.0
        self._lock = threading.RLock()  # callbacks of the browser against the loops
        self._page = 0
        # by the person; until then the device's kind says which is of interest
        self._page_chosen = False
        self._last: dict[str, int] = {}  # page that was open in each workspace
        self._rooms: list[dict] = []
        self._said: dict = {}  # of the view's state
        self._cursors: tuple[float, float] | tuple[()] = ()
        self._theme()
        self.scene = SceneView(client, self._choice)
        with client.atomic():
            self._build_left()
            self._build_right()

    @property
    def orders(self) -> tuple[Input, ...]:
        """Inputs that do more than change this browser's own view."""
        return *self._timeline.orders, *(h for page in self._pages for h in page.orders), self._role

    # --- ticks

    def tick_scene(self) -> None:
        """Poses, and less often trajectories."""
        with self._lock, self._store.lock, self._client.atomic():
            device = self._device()
            if device is None or self._span.paused_at is not None:
                return
            self.scene.update(device)
            now = time.monotonic()
            if self._fitting.moved(now):
                self.scene.reset_camera(device.body == "nav")
            if now - self._tracks_at > TRACK_S:
                self._tracks_at = now
                self.scene.trails.update(device)

    def tick_panels(self) -> None:
        """Summary, recorder and the page that is seen."""
        with self._lock, self._store.lock, self._client.atomic():
            if self._alone:
                self._shared.begin()
            now = time.monotonic()
            self._bar()
            self._record.update(self._store.recorder, now)
            self._timeline.update(now)
            self._show_replay_asked_for()
            device = self._device()
            self._say_state(device)
            if device is None:
                router = "no router: is `gyrofree router` running?"
                text = "no device has spoken yet: is `gyrofree gateway` running?"
                self._devices.waiting(text if self._desk.connected else router)
                return
            if device.generation != self._generation and self._span.paused_at is not None:
                self._pause(False)  # the frozen window belongs to a time axis that is gone
            self._generation = device.generation
            snapshot = self._snapshot(device, now)
            if not self._page_chosen:
                self._open(KEYS.index(FIRST[device.body]))
            if self._span.paused_at is None:
                self._devices.update(snapshot)
            page = self._pages[self._page]
            page.update(snapshot)
            page.tidy()

    def _snapshot(self, device: Device, now: float) -> Snapshot:
        clock = self._store.replay.clock(device.name, now)
        limits = self._span.in_round(device, self._shared)
        own = self._choice.dark, self._cursors, tuple(self._derived)
        return Snapshot(self._store, device, *limits, clock, *own, self._shared)

    # --- building

    def _build_left(self) -> None:
        gui = self._client.gui
        gui.set_panel_label("gyrofree")
        self._state = gui.add_html("")
        self._ask = gui.add_text(ASK, "")  # hidden by style.css: the page writes into it
        self._ask.on_update(lambda _: self._asked(Wish.of(self._ask.value)))
        self._role = gui.add_text(ROLE, "", visible=False)  # the relay writes into it
        self._role.on_update(lambda _: self._set_rights())
        self._devices = Devices(self._client, gui.add_folder(None))
        self._record = Record(self._client)
        self._timeline = Timeline(self._client, self._desk, self._store, lambda: self._device_name)

    def _build_right(self) -> None:
        gui = self._client.gui
        panel = gui.add_panel()
        with panel.add_tab("Charts", viser.Icon.CHART_LINE):
            self._rights = gui.add_html("", visible=False)
            self._folders = [gui.add_folder(None, visible=False) for _ in PAGES]
        self._pages = [
            page(self._client, folder) for page, folder in zip(PAGES, self._folders, strict=True)
        ]
        for page in self._pages:
            page.desk = self._desk
        self._fitting = Fitting(self._client, panel)
        self._open(0)

    # --- what is said to the page around the scene

    def _say_state(self, device: Device | None) -> None:
        if device is not None:
            made = partial(offered, PAGES, device)
            self._rooms = self._shared.once((device.name, "rooms"), made)
        page = PAGES[self._page]
        fields = dict(
            devices=self._store.names(),
            device=device.name if device is not None else "",
            workspace=page.workspace,
            page=page.key(),
            title=page.title,
            missing=page.missing(device) if device is not None else "",
            rooms=self._rooms,
            window=self._span.window,
            paused=self._span.paused_at is not None,
            **self._span.stated(device),
            derived=[] if device is None else judged(device, self._derived),
            dark=self._choice.dark,
            follow=self._choice.follow,
            size=self._fitting.size,
            quality=self.pace.quality,
            layers=[layer for layer in LAYERS if self._choice.layers[layer]],
        )
        if fields != self._said:
            self._said = fields
            self._state.content = str(tag("span", class_="gf-state", data_state=stated(**fields)))

    # --- what the person asks

    def _asked(self, wish: Wish) -> None:
        with self._lock, self._store.lock:
            if wish.device:
                self._wanted = wish.device
            if wish.prefer and not self._device_chosen and not self._wanted:
                self._choose(wish.prefer, by_person=False)
            self._span.ask(wish.window, wish.zoom)
            self.pace.choose(wish.quality)
            if wish.derived is not None:
                self._derived = many(wish.derived)
            if wish.dark is not None and wish.dark != self._choice.dark:
                self._set_dark(wish.dark)
            if wish.pause is not None:
                self._pause(wish.pause)
            if wish.follow is not None:
                self._choice.follow = wish.follow
            if wish.layers is not None:
                self._choice.layers.update({layer: layer in wish.layers for layer in LAYERS})
            if wish.cursors is not None:
                self._cursors = wish.cursors
            if wish.size is not None:
                self._fit(wish.size)
            self._turn_to(wish)
            for what in wish.do:
                if what == "camera":
                    self._reset_camera()
                if self._rights_of.operates:  # an order, by an input that is anybody's
                    self._timeline.do(what)
            self._say_state(self._device())

    def _turn_to(self, wish: Wish) -> None:
        """Open the page asked for, else the one open last in the workspace asked for."""
        if wish.page in KEYS:
            self._choose_page(KEYS.index(wish.page))
        elif wish.workspace in {room.key for room in WORKSPACES}:
            device = self._device()
            of_it = [k for k, page in enumerate(PAGES) if page.workspace == wish.workspace]
            there = [k for k in of_it if device is None or not PAGES[k].missing(device)]
            last = self._last.get(wish.workspace)
            if of_it:
                self._choose_page(last if last in there else (there or of_it)[0])

    def _fit(self, size: str) -> None:
        self._fitting.become(size, time.monotonic())
        self._choice.sheet = short = self._fitting.sheet
        self._devices.short = self._record.short = self._timeline.short = short

    def _theme(self) -> None:
        self._client.gui.configure_theme(
            dark_mode=self._choice.dark,
            show_logo=False,
            show_share_button=False,
            brand_color=(30, 110, 165),
        )

    def _set_dark(self, dark: bool) -> None:
        self._choice.dark = dark
        self._theme()

    def _set_rights(self) -> None:
        """Orders of this browser bear the name of who is signed in."""
        with self._lock:
            self._rights_of.become(self._role.value)
            for page in self._pages:
                page.user, page.desk = self._rights_of.user, self._rights_of.desk
            self._bar(anew=True)

    def _bar(self, anew: bool = False) -> None:
        """Grey the orders that would be refused now; a table may be stopped by whoever orders."""
        rights = self._rights_of
        if rights.look() or anew:
            self._timeline.bar(bool(rights.never))
            free = *self._timeline.orders, *(one for page in self._pages for one in page.always)
            rights.grey([one for one in self.orders if one is not self._role], free)
            self._say_rights()

    def _say_rights(self) -> None:
        barred = bool(self._rights_of.now and self._pages[self._page].orders)
        self._rights.content = str(alert(self._rights_of.now)) if barred else ""
        self._rights.visible = barred

    def _pause(self, pause: bool) -> None:
        with self._lock, self._store.lock:
            device = self._device()
            if pause and self._span.paused_at is not None:
                return
            self._span.paused_at = device.t_newest if pause and device is not None else None

    def _reset_camera(self) -> None:
        with self._lock, self._store.lock:
            device = self._device()
            self.scene.reset_camera(device is not None and device.body == "nav")

    def _choose(self, name: str, by_person: bool) -> None:
        with self._lock:
            if name != self._device_name and self._store.device(name) is not None:
                self._device_chosen |= by_person
                self._device_name = name
                if self._span.paused_at is not None:
                    self._pause(False)

    def _choose_page(self, index: int) -> None:
        with self._lock:
            self._page_chosen = True
            self._open(index)

    def _open(self, index: int) -> None:
        with self._lock:
            if index != self._page:
                self._pages[self._page].hide()
            self._page = index
            self._last[PAGES[index].workspace] = index
            self.scene.show(not self._pages[index].own_scene)
            self._choice.axis_names = PAGES[index].workspace in NAMING
            self._say_rights()
            for k, folder in enumerate(self._folders):
                if folder.visible != (k == index):
                    folder.visible = k == index

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

    def _device(self) -> Device | None:
        """The chosen device; the first one heard with data until somebody chooses."""
        if self._wanted and self._store.device(self._wanted) is not None:
            self._choose(self._wanted, by_person=True)
            self._wanted = ""
        if not self._device_name:
            speaking = [n for n in self._store.names() if self._store.devices[n].rings]
            self._device_name = (speaking or [""])[0]
        return self._store.device(self._device_name) if self._device_name else None

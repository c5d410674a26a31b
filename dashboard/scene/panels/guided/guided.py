"""What the guided pages have in common: a row of orders that come and go, and how far the person
has come.
"""

from typing import Any

import viser

from dashboard.scene.drawing.page import EMPTY, Markup, alert, note, tag
from dashboard.scene.drawing.palette import GREEN
from dashboard.scene.panels.base import Input, Panel, Snapshot

GONE_S = 3.0  # s without a word of a running guidance


class Guided(Panel):
    """A panel whose orders go to the estimator of the device; a subclass says which are of use
    now.
    """

    buttons: tuple[
        tuple[str, int, viser.Icon, Any], ...
    ] = ()  # label, EstimatorCommand.Action, icon, colour
    _status = None

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._device = ""
        self._buttons: dict[int, viser.GuiButtonHandle] = {}
        with folder:
            for k, (label, action, icon, colour) in enumerate(self.buttons):
                button = client.gui.add_button(
                    label, icon=icon, color=colour, order=2.0 + k, visible=False
                )
                button.on_click(lambda _, action=action: self._order(action))
                self._buttons[action] = button

    @property
    def orders(self) -> tuple[Input, ...]:
        """The buttons: a viewer may not press them."""
        return tuple(self._buttons.values())

    def _show(self, actions: set[int]) -> None:
        for action, button in self._buttons.items():
            if button.visible != (action in actions):
                button.visible = action in actions

    def _not_here(self, text: str) -> None:
        """This device has nothing to guide."""
        self._status = self.html(note(text), self._status)
        self._show(set())

    def _order(self, action: int) -> None:
        """Give the order of a button."""
        raise NotImplementedError


def silent(s: Snapshot, topic: str, running: bool) -> bool:
    """Whether nothing is heard any more of what runs."""
    latest = s.device.get(topic)
    return running and latest is not None and latest.age(s.now) > GONE_S


def head(state: str, detail: str, gone: bool) -> Markup:
    """The first line: state and counts, with an alarm above when the estimator is silent."""
    alarm = alert("the estimator is silent: does it still run?") if gone else EMPTY
    words = tag("span", state, class_="gf-name"), tag("span", detail)
    return alarm + tag("div", *words, class_="gf-head")


def guidance(instruction: str, drawing: Markup, progress: float, message: str) -> Markup:
    """What to do, as words and picture, how far it has come (0 to 1), and what was said last."""
    lead = tag("p", instruction, style="margin:.2em .75em;font-size:1.15em;font-weight:600")
    share = min(max(progress, 0.0), 1.0) if progress == progress else 0.0
    round_ = "height:100%;border-radius:.25em"
    done = tag("div", style=f"{round_};width:{100 * share:.0f}%;background:{GREEN}")
    around = "margin:.3em .75em;height:.5em;border-radius:.25em;background:rgba(128,128,128,.25)"
    return lead + drawing + tag("div", done, style=around) + note(message)

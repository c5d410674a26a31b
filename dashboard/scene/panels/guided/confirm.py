"""What is said once more before a test starts: which, how fast it turns, what a lost link does."""

from collections.abc import Callable

import viser

from dashboard.scene.drawing.page import EMPTY, Markup, alert, note, rows, tag
from dashboard.scene.drawing.palette import number
from dashboard.scene.panels.base import DEG
from messages.contract import gyrofree_pb2 as pb

YES, NO = "Yes, start it", "Do not start"
MINUTE_S = 60.0


class Confirm:
    """One question at a time, in a window over the page of one browser."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._modal: object | None = None

    @property
    def open(self) -> bool:
        """Is something asked?"""
        return self._modal is not None

    def ask(self, title: str, content: Markup, begin: Callable[[], None]) -> None:
        """Ask; begin() is called once where the answer is yes."""
        self.close()
        gui = self._client.gui
        self._modal = gui.add_modal(title)
        with self._modal:
            gui.add_html(str(content))
            yes = gui.add_button(YES, icon=viser.Icon.PLAYER_PLAY, color=(200, 30, 30))
            no = gui.add_button(NO, icon=viser.Icon.X, color="gray")

        def answered(start: bool) -> None:
            if self.open:
                self.close()
                if start:
                    begin()

        yes.on_click(lambda _: answered(True))
        no.on_click(lambda _: answered(False))

    def close(self) -> None:
        """Ask no more: it was answered, or another test began meanwhile."""
        modal, self._modal = self._modal, None
        if modal is not None:
            modal.close()


def content(m: pb.ProcedureStatus, name: str, unit: str) -> Markup:
    """What a person has to know before a test starts; unit: the serial number."""
    offer = next((one for one in m.offers if one.name == name), None)
    facts: list[tuple[str, object]] = [("procedure", name), ("serial number", unit or "not given")]
    if offer is None:
        fastest = "not known here"
    elif offer.fault:
        fastest = "not known"
    elif offer.top_radps == 0.0:
        fastest = "it stands still"
    else:
        fastest = number(offer.top_radps * DEG, 0, "°/s")
    if offer is not None and not offer.fault:
        facts.insert(1, ("what it is", offer.title))
        facts.append(("steps", f"{offer.steps}, {_duration(offer.seconds)} at least"))
    facts.append(("fastest", tag("b", fastest)))
    facts.append(("table", m.table or "turned by hand"))
    moves = bool(m.table) and (offer is None or offer.top_radps > 0.0)
    warning = alert("The table begins to turn: is it free, and is nobody near it?")
    wrong = alert(offer.fault) if offer is not None and offer.fault else EMPTY
    lost = m.if_lost or "What happens when the link is lost is not said: is the service older?"
    return (warning if moves else EMPTY) + wrong + rows(facts) + note(lost)


def _duration(seconds: float) -> str:
    if seconds < 2 * MINUTE_S:
        return f"{seconds:.0f} s"
    return f"{seconds / MINUTE_S:.0f} min"

"""One thing that is wrong, as the page shows it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Alarm:
    """One thing that is wrong."""

    kind: str  # of a kind: "axis", "link", "board", "estimator", "late", "blind", ...
    title: str  # in a few words
    text: str  # what was found and what to do
    page: str  # key of the page that shows it; "" for none
    about: str = ""  # which axis, filter or fault it is
    level: str = ""  # watch, warning or critical, where the service has said so
    state: str = ""  # unacknowledged or acknowledged, likewise
    raised_s: float = 0.0  # s since 1970, likewise
    lasted: bool = False  # whoever found it has waited for it to stay

    @property
    def id(self) -> str:
        """Stays while what is said of it changes."""
        return f"{self.kind}-{self.about}" if self.about else self.kind

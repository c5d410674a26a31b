"""What was wrong with an MCAP file, in one account that every reader shows."""

from dataclasses import dataclass, field


@dataclass
class Damage:
    """What of a file that was read to its readable end is missing or doubtful."""

    chunks: int = 0  # with a wrong CRC, or not to be decompressed
    records: int = 0  # messages and declarations outside of chunks that cannot be read
    oversized: int = 0  # records and chunks beyond the limit
    undecodable: int = 0  # messages whose bytes are no message of their topic
    orphans: int = 0  # messages of channels that no readable record declares
    missing: int = 0  # messages that the file's own statistics count beyond those that were read
    index: bool = False  # the summary at the end contradicts its CRC
    checksum: bool = False  # the data section contradicts its CRC
    tail: str = ""  # why reading ended before the file's end; empty when it did not
    messages: int = 0  # that were read, of others too
    unchecked: int = 0  # of these, not covered by any checksum
    growing: bool = False  # somebody is writing it: that it has no end is no damage
    foreign: dict[str, int] = field(default_factory=dict)  # what others wrote -> messages left out

    @property
    def whole(self) -> bool:
        """Was everything read that the file had when it was written?"""
        return not self._parts()

    def __str__(self) -> str:
        return "; ".join(self._parts()) or "no damage"

    @property
    def others(self) -> str:
        """What other programs wrote into the file, in words; empty where it is ours alone."""
        if not self.foreign:
            return ""
        names = sorted(self.foreign)
        more = f" and {len(names) - 5} more" if len(names) > 5 else ""
        total = sum(self.foreign.values())
        return f"{total} messages left out, not of this program: {', '.join(names[:5])}{more}"

    def _parts(self) -> list[str]:
        counted = {
            "damaged chunks left out": self.chunks,
            "damaged records left out": self.records,
            "records that are too long left out": self.oversized,
            "messages of unknown channels left out": self.orphans,
            "messages cannot be decoded": self.undecodable,
            "messages are missing by the file's own count": self.missing,
        }
        parts = [f"{number} {what}" for what, number in counted.items() if number]
        parts += ["its index is damaged"] if self.index else []
        parts += ["its data contradict their checksum"] if self.checksum else []
        return parts + ([self.tail] if self.tail else [])

    def said(self) -> list[str]:
        """Sentences for people; none for a file that is whole and ours alone."""
        said = [] if self.whole else [f"damaged: {self}; {self.messages} messages were read"]
        if self.growing and self._parts() == [self.tail]:
            said = [f"still being recorded: the {self.messages} messages so far were read"]
        said += [self.others] if self.foreign else []
        if self.unchecked and self.whole:
            said.append(f"{self.unchecked} messages have no checksum: errors in them do not show")
        return said

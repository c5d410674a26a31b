"""What is said to happen when a link is lost is what the table's own settings are."""

import pytest

from sessions.procedure.desk import if_lost
from sessions.procedure.driven.description import described
from sessions.procedure.driven.guard import HANGS_S
from sessions.procedure.driven.table import TextTable


@pytest.mark.parametrize("seconds", [2.0, 7.5])
def test_the_tables_own_watchdog_is_said_with_its_time(seconds):
    said = described("simulated").model_copy(update={"watchdog_s": seconds})
    text = if_lost(TextTable(said, "tcp://127.0.0.1:1"))
    assert f"its own watchdog after {seconds:g} s" in text and f"hang for {HANGS_S:g} s" in text
    assert len(text) <= 600


def test_a_table_without_a_watchdog_turns_on_and_a_hand_does_not():
    simulated = described("simulated")
    none = simulated.commands.model_copy(update={"watchdog": ""})
    text = if_lost(TextTable(simulated.model_copy(update={"commands": none}), "tcp://127.0.0.1:1"))
    assert "TURNS ON" in text and "watchdog after" not in text and len(text) <= 600
    assert "by hand" in if_lost(None)

"""All scenarios, in the order of the table, and the proofs that are tests elsewhere."""

from dataclasses import dataclass

from faults.of_disks import DISKS
from faults.of_processes import PROCESSES
from faults.of_sites import SITES
from faults.of_the_bus import BUS
from faults.of_the_line import LINE
from faults.of_the_link import LINK
from faults.of_the_machine import MACHINE
from faults.scenario import Scenario

SCENARIOS: dict[str, tuple[Scenario, ...]] = {
    "The line and the board": LINE,
    "Processes": PROCESSES,
    "Disks and the clock": DISKS,
    "Memory, files and journals": MACHINE,
    "The bus": BUS,
    "Certificates": SITES,
    "The link between two places": LINK,
}


@dataclass(frozen=True)
class Proof:
    """A fault that a test of another room does."""

    fault: str
    lost: str
    said: str
    tests: tuple[str, ...]  # below tests/, with `::name` where it is one of a file


PROOFS = (
    Proof(
        "the stream is cut at any byte; single bytes are wrong, doubled or missing",
        "the frames that were touched, counted truly",
        "`bad_chunks`, `lost_frames`, `damage` of the link",
        ("firmware_protocol/test_proofs.py",),
    ),
    Proof(
        "a frame with a good CRC and a length, version, type, index or time that cannot be",
        "that frame",
        "`refused` of the link, by name",
        ("gateway/test_hostile_frames.py",),
    ),
    Proof(
        "the port is busy, absent, not permitted, or an ordinary file",
        "nothing that could be read",
        "one line with the remedy; it goes on trying",
        ("gateway/test_ports.py",),
    ),
    Proof(
        "the clock of the board jumps, wraps or runs fast; samples come in a burst after a stall",
        "nothing",
        "`clock_skew_ppm`, fault `clock-jump`",
        ("gateway/test_clock.py",),
    ),
    Proof(
        "an axis is stuck, saturated, exchanged, spiking or biased; a filter is contradicted",
        "nothing; the axis is left out and named",
        "`axes`, alarms `axis-...`",
        ("inertial/test_health.py", "gyrofree/test_alarms.py"),
    ),
    Proof(
        "axes are exchanged in the settings; the board moves while it levels",
        "nothing; the axes are left out, levelling begins again",
        "`axes`, the reason in the filter's state",
        (
            "logs/test_cube_parts.py::test_swapped_axes_are_named_and_left_out",
            "inertial/test_alignment.py::test_moving_during_levelling_begins_it_again_and_says_why",
        ),
    ),
    Proof(
        "positions jump, are dragged away slowly, or stay away for long",
        "the fixes that are not believed",
        "alarm `contradicted-...`; sigma and the age of the fix grow",
        (
            "inertial/test_drag.py",
            "inertial/test_navigation.py::test_sigma_and_fix_age_grow_in_an_outage",
        ),
    ),
    Proof(
        "a line ten times as fast as any board",
        "what is beyond the buffers, counted",
        "the link's message: reading waits",
        ("gateway/test_backlog.py",),
    ),
    Proof(
        "GNSS: no fix, a wrong checksum, a week that begins anew, a leap second, midnight",
        "that fix",
        "`gnss_bad`, `refused` of the link",
        ("gateway/test_gnss.py", "gateway/test_receivers.py", "gateway/test_receiver_line.py"),
    ),
    Proof(
        "the gateway is killed at any byte",
        "nothing; no sample comes twice",
        "a new `run`",
        ("gateway/test_resume.py", "system/test_kill.py"),
    ),
    Proof(
        "a journal is torn, damaged, full, or somebody else's",
        "the records that were hit",
        "the link's message",
        ("gateway/test_journal.py",),
    ),
    Proof(
        "a recording is cut, flipped, empty, or none at all",
        "the chunks that were hit",
        "every command and page says the damage; it is never complete",
        ("sessions/test_mcap_damage.py", "sessions/test_store.py"),
    ),
    Proof(
        "the disk of the sessions cannot be written",
        "what is not recorded, which is said",
        "the order to record is refused with the reason",
        ("sessions/test_store.py::test_a_root_that_cannot_be_written_leaves_nothing_behind",),
    ),
    Proof(
        "the wall clock is set back and forward by a year; the gateway is stopped for 4 s",
        "nothing",
        "`clock_offset_s`, `clock_steps`, `stops`",
        ("system/test_wall_clock.py", "messages/test_clock.py", "sessions/test_stepped.py"),
    ),
    Proof(
        "two gateways of one board, two of each service, one that was stopped comes back",
        "nothing; one serves, the other waits",
        "a line that says which; `refused[stale]`",
        ("system/test_fencing.py", "system/test_two_of_each.py", "messages/test_fencing.py"),
    ),
    Proof(
        "somebody on the bus answers questions and orders, for ever, never, or falsely",
        "nothing; others are neither believed nor waited for",
        "`refused[claim]`, a line that names him",
        ("messages/test_liars.py", "sessions/test_hostile_bus.py", "estimator/test_hostile_bus.py"),
    ),
    Proof(
        "messages are lost at random; a cable is cut",
        "nothing that a publisher kept",
        "`repaired` of the certificate",
        ("sessions/test_repair.py",),
    ),
    Proof(
        "no certificate, a foreign authority, one that ended, one of another role",
        "nothing; 0 of 10,000 messages are taken",
        "a line that says why nobody answers; `gyrofree site check`",
        ("sites/test_bus_of_a_site.py",),
    ),
    Proof(
        "a link between two places breaks while recordings are copied",
        "nothing; the copy goes on and is equal",
        "`gyrofree site copies`",
        ("sites/test_copies.py",),
    ),
    Proof(
        "a hostile client of the scene: any message of viser's, and none of its",
        "nothing; no widget changes",
        "the count of refused messages on the page of users",
        ("dashboard/test_web_fuzz.py", "dashboard/test_proxy.py"),
    ),
    Proof(
        "a slow browser, many connections, drips, endless bodies, floods",
        "that connection",
        "the count by reason on the page of users",
        ("dashboard/test_connections.py", "dashboard/test_api.py"),
    ),
    Proof(
        "bodies that are no JSON, too deep or of no numbers; names that lead out of the folder",
        "nothing",
        "the answer names what is wrong, never an error of the server",
        (
            "dashboard/test_api.py::test_bad_bodies_are_named_and_never_a_server_fault",
            "dashboard/test_api.py::test_paths_do_not_leave_the_folder",
        ),
    ),
    Proof(
        "guessing, an expired or revoked sign-in, a viewer's orders, another site's requests",
        "nothing",
        "who did what, on the page of admins",
        ("dashboard/test_auth.py", "dashboard/test_accounts.py", "dashboard/test_orders.py"),
    ),
    Proof(
        "a procedure: recorder, board, tachometer or table fall silent; its service is killed",
        "the dwell that was spoilt, which is repeated",
        "the step's reason; alarm `table-alone`",
        ("sessions/test_procedure_faults.py", "sessions/test_procedure_unkind.py"),
    ),
    Proof(
        "a key of the configuration is unknown, wrong, or its file is not there",
        "nothing is started",
        "file, line, section and the nearest key",
        ("gyrofree/test_config.py", "gyrofree/test_broken_files.py"),
    ),
    Proof(
        "services start in any order; a port is taken",
        "nothing; nothing is started at another port",
        "which port, and what to do",
        (
            "messages/test_messages.py::test_a_client_may_start_before_its_router_and_messages_arrive",
            "gyrofree/test_cli.py::test_a_taken_port_is_said_and_no_other_is_used",
        ),
    ),
    Proof(
        "notices cannot be delivered",
        "nothing for a day",
        "what waits and what was given up, on the page of alarms",
        ("dashboard/test_alarm_notices.py",),
    ),
)

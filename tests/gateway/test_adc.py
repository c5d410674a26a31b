"""An analogue board on the line: its counts and what they mean reach the bus."""

from pathlib import Path

import pytest

from firmware_protocol.codec import encode
from firmware_protocol.frames import Adc
from gateway.board.device import DeviceLink
from gateway.ports.reader import Chunk
from gateway.samples.analogue import AnalogueChannel, AnalogueSettings
from gateway.settings import DeviceSettings, GatewaySettings
from messages.contract.topics import ADC, IMU
from messages.history.journal_file import BOARD

LEVEL = (2048, 2048, 2641, 1526, 1526)  # counts of the Acc_Gyro board at rest: +1 g on its z


@pytest.fixture
def link(tmp_path: Path):
    """A link without a port, live, and what it puts."""
    made = []

    def make(**settings):
        device = DeviceSettings(name="analogue", port="file:///dev/null", **settings)
        link = DeviceLink(device, GatewaySettings(journal=tmp_path / "journal", devices=[device]))
        said = []
        link.out.direct(lambda topic, name, message: said.append((topic, message)))
        made.append(link)
        return link, said

    yield make
    for one in made:
        one.journal.close()
        one.spool.close()


def send(
    link: DeviceLink, first: int, rows: list[tuple[int, ...]], mask: int = 0b11111, seq: int = 0
) -> None:
    frame = Adc(
        first_index=first, period_ns=10_000_000, channel_mask=mask, vref_mv=3300, counts=tuple(rows)
    )
    data = encode(frame, epoch=1, seq=seq, t_us=first * 10_000)
    link.take(Chunk(BOARD, data, 1_000_000_000 + first * 10_000_000))


def of(said, topic):
    return [message for t, message in said if t is topic]


def test_counts_and_their_meaning_reach_the_bus(link):
    gateway, said = link()
    send(gateway, 0, [LEVEL] * 5)
    send(gateway, 5, [LEVEL] * 5, seq=1)
    adc, imu = of(said, ADC), of(said, IMU)
    assert [m.first_index for m in adc] == [m.first_index for m in imu] == [0, 5]
    assert adc[0].channels == 5 and list(adc[0].counts) == list(LEVEL) * 5
    assert adc[0].volt_per_count == pytest.approx(3.3 / 4095)
    assert imu[0].f_b_mps2[:3] == pytest.approx([0.0, 0.0, -9.8], abs=0.05)
    assert imu[0].omega_ib_b_radps[:3] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    assert imu[1].header.device_us == 50_000 and imu[1].header.device == "analogue"


def test_the_wiring_is_configuration(link):
    swapped = AnalogueSettings(
        accel_x=AnalogueChannel(channel=2), accel_z=AnalogueChannel(channel=0)
    )
    gateway, said = link(analogue=swapped)
    send(gateway, 0, [LEVEL])
    send(gateway, 1, [LEVEL] * 2, seq=1)
    assert of(said, IMU)[0].f_b_mps2[0] == pytest.approx(9.8, abs=0.05)


def test_a_board_that_lacks_an_input_gives_counts_only_and_a_warning(link, caplog):
    gateway, said = link()
    send(gateway, 0, [LEVEL[:4]] * 4, mask=0b1111)
    assert of(said, ADC)[0].channels == 4
    assert not of(said, IMU)
    assert "no counts of inputs [4]" in caplog.text


def test_lost_samples_are_counted(link):
    gateway, said = link()
    send(gateway, 0, [LEVEL] * 2)
    send(gateway, 7, [LEVEL] * 2, seq=1)
    assert [m.lost_samples for m in of(said, ADC)] == [0, 5]
    assert [m.lost_samples for m in of(said, IMU)] == [0, 5]

"""The unit that has systemd run `gyrofree up`."""

import getpass
import shlex
from pathlib import Path

from gyrofree.running.process import EXIT_CONFIG, command
from gyrofree.running.supervisor import PATIENCE

HEAD = """# Written by `gyrofree up --systemd`. To install:
#   gyrofree up --systemd | sudo tee /etc/systemd/system/gyrofree.service
#   sudo systemctl enable --now gyrofree
# Its log: journalctl -u gyrofree -f
"""


def unit(config: Path | None, arguments: list[str], folder: Path) -> str:
    """A unit file. folder: where relative paths of the configuration begin."""
    words = [f"--config={config.absolute()}"] if config else []
    start = " ".join(_quoted(word) for word in command("up", *words, *arguments))
    return (
        HEAD
        + f"""
[Unit]
Description=gyrofree: boards, estimators, recorder and dashboard
After=network.target time-sync.target

[Service]
Type=simple
User={getpass.getuser()}
WorkingDirectory={str(folder).replace("%", "%%")}
ExecStart={start}
# A wrong configuration is not mended by another start.
Restart=on-failure
RestartSec=2
RestartPreventExitStatus={EXIT_CONFIG}
# The supervisor ends its services in order; systemd steps in when it does not.
KillMode=mixed
TimeoutStopSec={PATIENCE + 4:.0f}
NoNewPrivileges=true
PrivateTmp=true
ProtectSystem=full

[Install]
WantedBy=multi-user.target
"""
    )


def _quoted(word: str) -> str:
    """A word of ExecStart: systemd's specifiers and variables are not meant."""
    plain = word.replace("%", "%%").replace("$", "$$")
    if shlex.quote(word) == word:
        return plain
    return '"' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"'

"""`gyrofree site zenohd-config`: Zenoh's own router with the listeners, certificates and rules of
this place.
"""

import json
from pathlib import Path
from typing import Annotated

import typer
import zenoh

from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.commands.parser import output_file
from gyrofree.config import ConfigError
from gyrofree.running.process import EXIT_CONFIG, fail


def zenohd_config(
    out: Annotated[
        Path | None,
        typer.Option(
            callback=output_file(), help="File that ends in .json5 or .json; none: it is printed."
        ),
    ] = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Write the configuration of `zenohd`, to run in place of our router.

    Where `gyrofree up` runs it, by [bus] zenohd, that is done by itself, and again when somebody
    joins or is sent away.
    """
    from gyrofree.setup.site import router_rules
    from inertial.whole_file import whole
    from messages.bus.faults import IdentityError
    from messages.bus.zenohd import zenohd_configuration

    settings = settings_of(config)
    try:
        rules, mesh = router_rules(settings)
        text = zenohd_configuration(settings.bus.acting_as("router"), rules, mesh)
        if out is not None:
            with whole(out) as draft:
                draft.write_text(text)
    except (ConfigError, IdentityError, OSError, zenoh.ZError) as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        return say(json.dumps({"file": str(out or ""), "configuration": json.loads(text)}))
    if out is None:
        return say(text, end="")
    say(f"{out} written: zenohd --config {out}")
    say("write it anew when somebody joins, is sent away, or has another certificate")

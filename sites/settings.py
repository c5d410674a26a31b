"""[site] of gyrofree.toml."""

from pydantic import BaseModel, ConfigDict

from messages.contract.topics import MOST_LANES
from messages.setting import setting


class SiteSettings(BaseModel):
    """What home does for places that watch it from afar."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    lanes: int = setting(
        6,
        "connections to each other place for recordings and overviews, beside the one that is"
        " live: over a link with losses one carries a fraction of it; 0: all goes over that one",
        ge=0,
        le=MOST_LANES,
    )

"""The router's rules of access: by common name, and what no rule allows is denied.

Zenoh refuses silently: a denied message is dropped at the router, and who sent it hears nothing.
`gyrofree site check` finds out, and says which rule is missing.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from messages.contract.names import NAME
from messages.contract.topics import NOTE, ORDER, clock_key
from messages.previews.frames import lane_key, overview_key
from sites.authority import Issued
from sites.place import Peer, Place
from sites.roles import (
    Rights,
    alive_keys,
    claim_keys,
    join_key,
    listening,
    order_keys,
    ordered,
    presence,
    presence_of,
    preview_keys,
    renew_key,
    rights,
    segment_key,
    topic_keys,
)

SAY = ("put", "delete", "declare_queryable", "reply", "liveliness_token")
HEAR = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")


class Rules:
    """Collects rules, subjects and policies in the form that Zenoh reads."""

    def __init__(self) -> None:
        self._rules: list[dict[str, Any]] = []
        self._policies: list[dict[str, Any]] = []
        self._subjects: list[dict[str, Any]] = []

    def allow(self, names: Iterable[str], said: Rights, hears: Iterable[str] = ()) -> None:
        """What the holders of these common names may say, and what keys they may hear."""
        names = sorted(set(names))
        if not names:
            return
        hears, number = list(hears), len(self._subjects)
        allowed = [
            ("ingress", ("put", "delete"), said.put),
            ("ingress", ("liveliness_token",), said.token),
            ("ingress", ("declare_queryable", "reply"), said.answer),
            ("ingress", ("query",), said.ask),
            ("egress", ("query",), said.answer),
            ("egress", ("reply", "declare_queryable"), said.ask),
            ("ingress", HEAR[:1], _widely(hears)),
            ("ingress", HEAR[2:], hears),
            ("egress", SAY, hears),
            # what the holder says is wanted elsewhere: he may know by whom
            ("egress", ("declare_subscriber",), _widely(said.put)),
            ("egress", ("liveliness_query", "declare_liveliness_subscriber"), said.token),
        ]
        ids = []
        for index, (flow, messages, keys) in enumerate(allowed):
            if keys:
                ids.append(f"rule-{number}-{index}")
                self._rules.append(
                    {
                        "id": ids[-1],
                        "permission": "allow",
                        "flows": [flow],
                        "messages": list(messages),
                        "key_exprs": sorted(set(keys)),
                    }
                )
        if ids:
            subject = f"subject-{number}"
            self._subjects.append({"id": subject, "cert_common_names": names})
            self._policies.append({"rules": ids, "subjects": [subject]})

    def config(self) -> dict[str, Any]:
        """The value of Zenoh's `access_control`."""
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": self._rules,
            "subjects": self._subjects,
            "policies": self._policies,
        }


def _widely(keys: Iterable[str]) -> list[str]:
    """Whoever may hear some keys of a site may subscribe to all of it at once; previews are not in
    that.
    """
    return [key if "@" in key else f"{key.split('/')[0]}/**" for key in keys]


def rules_of(
    place: Place, certificates: Iterable[Issued], devices: Mapping[str, Iterable[str]]
) -> dict[str, Any]:
    """Rules of this place's router.

    certificates: those that stand, of this place and its peers. devices: by the common name of a
    gateway, the boards whose keys it may publish.
    """
    rules, peers = Rules(), {peer.place: peer for peer in place.peers}
    for each in certificates:
        if each.place == place.place:  # its router is a client where zenohd routes
            mine = devices.get(each.common_name, each.devices)
            _local(rules, place, each, mine)
        elif each.role == "join":
            rules.allow([each.common_name], rights("join", place.site))
        elif each.role == "router" and each.place in peers:
            _between(rules, place, peers[each.place], each.common_name)
        elif each.role == "authority" and each.place == place.home:
            rules.allow([each.common_name], Rights(answer=(f"{lane_key(place.site, '*')}/**",)))
    return rules.config()


def _local(rules: Rules, place: Place, holder: Issued, devices: Iterable[str]) -> None:
    """A process of this place."""
    said = rights(holder.role, place.site, devices)
    if place.seat == "viewer":
        watching = (*listening(place.site), renew_key(place.site))
        said = Rights(ask=tuple(key for key in said.ask if key in watching))
    elif holder.role == "authority" and place.at_home:
        home = (
            join_key(place.site),
            renew_key(place.site),
            f"{segment_key(place.site)}/**",
            clock_key(place.site),
            overview_key(place.site, "*"),
        )
        said += Rights(put=preview_keys(place.site), answer=home)
    # a machine of its own says its own name
    for name in {place.place, holder.common_name.partition(".")[2]}:
        if NAME.fullmatch(name):
            said += presence(place.site, name, holder.role)
            if place.seat == "operator":
                said += ordered(place.site, name, holder.role)
    rules.allow([holder.common_name], said, [f"{place.site}/**", *preview_keys(place.site)])


def _between(rules: Rules, place: Place, peer: Peer, router: str) -> None:
    """The router of another place: home speaks, the others listen, and order where their seat is
    an operator's.
    """
    site = place.site
    seat = peer.seat if place.at_home else place.seat
    asks = (*listening(site), renew_key(site), *(order_keys(site) if seat == "operator" else ()))
    away = peer.place if place.at_home else place.place  # an order is in the name of its place
    said = (NOTE.pattern(site), ORDER.pattern(site, away)) if seat == "operator" else ()
    notes = Rights(put=said)
    heard = (*topic_keys(site), *claim_keys(site), alive_keys(site), *preview_keys(site))
    if place.at_home:
        there = presence_of(site, peer.place)
        rules.allow([router], Rights(ask=asks) + notes + there, heard)
        return
    token = (*claim_keys(site), alive_keys(site))
    home = Rights(put=(*topic_keys(site), *preview_keys(site)), token=token, answer=asks)
    here = presence_of(site, place.place)
    said = (*said, *here.put, *here.token)
    rules.allow([router], home, said)

"""Requests that nobody's page would send, to a real front door: by the REST interface's own
description (schemathesis), and to every route of the application, pages too.
"""

import contextlib
import string
from collections import Counter

import httpx
import schemathesis
from fastapi.routing import APIRoute
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode

from dashboard.web.app import create_app
from dashboard.web.guard import Guard
from support.front_door import Door
from support.hostile import HOSTILE

# Text under which a value is refused because this door has no bus: said, and no fault.
NO_SERVICE = (
    "was started without",
    "no connection",
    "cannot replay",
    "is not available",
    "has no",
    "not here",
)
TEXTS = st.sampled_from(HOSTILE) | st.text(max_size=30) | st.sampled_from(["nan", "-1", "1e999"])
NAMES = (
    "name password role remove role_only end csrf old new again key next token user days revoke q"
    " look later port baud text at_s note session t a b form state code"
).split()


def quiet(examples: int) -> settings:
    """The same requests in every run, so many; a machine may be busy."""
    return settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate],
    )


def routes_of(app) -> list[APIRoute]:
    """Every route, also of the routers that were taken in."""
    found = []
    for route in app.routes:
        if isinstance(route, APIRoute):
            found.append(route)
        elif inner := getattr(route, "original_router", None):
            found += routes_of(inner)
    return found


class Fuzz:
    """Sends, counts the answers by status, and keeps what was a fault of the server."""

    def __init__(self, client: httpx.Client, known: dict[str, list[str]]) -> None:
        """known: values of path parameters that exist, so that requests get behind the door."""
        self.client, self.known = client, known
        self.codes: Counter[int] = Counter()
        self.faults: list[str] = []

    def send(self, method: str, url: str, **options) -> None:
        """One request; an answer that has no end is left after its head."""
        try:
            request = self.client.build_request(method, url, **options)
        except (httpx.InvalidURL, UnicodeEncodeError, TypeError, ValueError):
            return  # a client that speaks HTTP cannot send this
        try:
            answer = self.client.send(request, stream=True)
        except (httpx.LocalProtocolError, httpx.RemoteProtocolError, httpx.WriteError) as error:
            self.codes[0] += 1
            if not isinstance(error, httpx.LocalProtocolError):
                self.faults.append(f"{method} {url}: {error!r}")
            return
        try:
            self.codes[answer.status_code] += 1
            if answer.status_code >= 500:
                text = answer.read().decode(errors="replace")
                if answer.status_code != 503 or not any(word in text for word in NO_SERVICE):
                    self.faults.append(f"{method} {url} {options}: {answer.status_code} {text}")
        finally:
            answer.close()

    def by_description(self, examples: int) -> None:
        """Every operation of /api/openapi.json, with what it describes and what it does not."""
        schema = schemathesis.openapi.from_dict(self.client.get("/api/openapi.json").json())
        for found in schema.get_all_operations():
            operation = found.ok()
            given_path = {k: v[0] for k, v in self.known.items() if f"{{{k}}}" in operation.path}
            for mode in GenerationMode:
                for path in [None, given_path] if given_path else [None]:
                    self._operation(operation, mode, path, examples)

    def _operation(self, operation, mode, path, examples: int) -> None:
        made = operation.as_strategy(generation_mode=mode, path_parameters=path)

        @quiet(examples)
        @given(made)
        def run(case) -> None:
            wanted = case.as_transport_kwargs(base_url=str(self.client.base_url))
            ours = {"cookie", "x-csrf-token", "origin", "host", "content-length"}
            headers = {k: v for k, v in wanted.pop("headers").items() if k.lower() not in ours}
            options = {"headers": headers, "params": wanted.get("params")}
            if "json" in wanted:
                options["json"] = wanted["json"]
            if isinstance(wanted.get("data"), bytes | str):
                options["content"] = wanted["data"]
            self.send(wanted["method"], wanted["url"], **options)

        with contextlib.suppress(Unsatisfiable):  # nothing can be wrong where nothing is asked
            run()

    def every_route(self, examples: int) -> None:
        """All of the application with any query, form and body; only signing out is left out."""
        door = create_app(self.client.front)  # type: ignore[attr-defined]
        assert isinstance(door, Guard)
        found = [
            (method, route.path)
            for route in routes_of(door._app)
            for method in sorted(route.methods)
            if route.path != "/logout"
        ]
        assert len(found) > 60

        @quiet(examples)
        @given(st.data())
        def run(data: st.DataObject) -> None:
            method, path = data.draw(st.sampled_from(found))
            for part in [p for _, p, _, _ in string.Formatter().parse(path) if p]:
                name = part.partition(":")[0]
                value = data.draw(st.sampled_from(self.known.get(name, ["x"])) | TEXTS)
                path = path.replace(f"{{{part}}}", str(httpx.QueryParams({"": value}))[1:])
            fields = data.draw(st.dictionaries(st.sampled_from(NAMES), TEXTS, max_size=6))
            options = {"params": data.draw(st.dictionaries(st.sampled_from(NAMES), TEXTS))}
            if method not in ("GET", "HEAD"):
                fields["csrf"] = self.client.headers["x-csrf-token"]
                body = data.draw(st.sampled_from(["form", "json", "raw"]))
                if body == "form":
                    options["data"] = fields
                elif body == "json":
                    options["json"] = fields
                else:
                    options["content"] = data.draw(st.binary(max_size=300))
            self.send(method, path, **options)

        run()


def fuzz(door: Door, name: str, known: dict[str, list[str]], examples: int) -> Fuzz:
    """As that user; `examples` requests of each kind for each operation, 150 times as many for all
    routes.
    """
    with door.client(name) as client:
        client.front = door.front  # type: ignore[attr-defined]
        run = Fuzz(client, known)
        run.by_description(examples)
        run.every_route(150 * examples)
    return run

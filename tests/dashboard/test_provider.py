"""Sign-in by a lab's identity provider: a real one on the loopback, right and lying."""

import html
import re
import time
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
from joserfc.jwk import RSAKey
from support.front_door import Door, open_door
from support.oidc_provider import SECRET_KEY, Lab, open_lab

from dashboard.settings import DashboardSettings
from dashboard.web.users import add_user, remove_user

GROUPS = {"oidc_admins": ["chiefs"], "oidc_operators": ["operators"], "oidc_viewers": ["staff"]}


@pytest.fixture(scope="module")
def lab():
    with open_lab() as opened:
        yield opened


@pytest.fixture(scope="module")
def shared(tmp_path_factory, lab):
    folder = tmp_path_factory.mktemp("provider")
    options = {
        "oidc_issuer": lab.issuer,
        "oidc_client": "bench",
        "oidc_address": "http://localhost",
    }
    with open_door(folder, scene=False, **options, **GROUPS) as opened:
        yield opened


@pytest.fixture
def door(shared: Door, lab: Lab):
    """With a provider that tells the truth again."""
    before = dict(vars(lab))
    yield shared
    vars(lab).update(before)


def way(door: Door, client: httpx.Client, wanted: str = "/sessions") -> str:
    """To the provider and with its answer to the door, which is at another port in the test: the
    path and query of the way back.
    """
    there = client.get("/login/provider", params={"next": wanted})
    assert there.status_code == 303, there.text
    back = urlsplit(httpx.get(there.headers["location"]).headers["location"])
    assert back.netloc == "localhost" and back.path == "/login/provider/back"
    return f"{back.path}?{back.query}"


def test_a_person_of_the_lab_signs_in_with_the_role_of_his_groups(door: Door, lab: Lab):
    for groups, role in (
        (["operators", "x"], "operator"),
        (["staff", "chiefs"], "admin"),
        ("staff", "viewer"),
    ):
        lab.claims = {"preferred_username": "lena", "groups": groups}
        with door.client() as client:
            assert "Sign in with your account of lab" in client.get("/login").text
            page = client.get(way(door, client))
            assert page.status_code == 200 and 'content="0;url=/sessions"' in page.text
            cookies = page.headers.get_list("set-cookie")
            assert any("samesite=strict" in c.lower() and "httponly" in c.lower() for c in cookies)
            me = client.get("/api/me").json()
            assert (me["user"], me["role"]) == ("lena@lab", role)
            account = client.get("/account").text
            assert "identity provider" in account and "Change your password" not in account
            with door.client("anna") as anna:
                assert "lena@lab" in anna.get("/users").text
                form = {"csrf": anna.headers["x-csrf-token"], "name": "lena@lab", "end": "1"}
                assert anna.post("/users", data=form).status_code == 303
            assert client.get("/api/me").status_code == 401
    asked = lab.asked[-1]
    assert asked["code_challenge_method"] == "S256" and asked["scope"] == "openid profile"
    with door.client("otto") as client:  # local users stay beside it
        assert client.get("/api/me").json()["user"] == "otto"


def sign_out(client: httpx.Client) -> httpx.Response:
    form = {"csrf": client.get("/api/me").json()["csrf"]}
    answer = client.post("/logout", data=form)
    assert client.get("/api/me").status_code == 401
    return answer


def test_who_signs_out_here_is_led_to_sign_out_at_the_provider_too(door: Door, lab: Lab):
    with door.client() as client:
        client.get(way(door, client))
        page = sign_out(client)
        assert page.status_code == 200 and "max-age=0" in page.headers["set-cookie"].lower()
        there = html.unescape(re.search(r'content="0;url=([^"]+)"', page.text)[1])
        assert there.startswith(f"{lab.issuer}/leave?of=lab&")
        back = httpx.get(there)
        assert back.status_code == 302 and back.headers["location"] == "http://localhost/login"
        assert lab.left[-1] == "lena"
    with door.client("otto") as client:  # who came with a password has nothing to end there
        assert sign_out(client).headers["location"] == "/login"


@pytest.mark.parametrize("said", [None, "http://example.org/leave", "javascript:alert(1)", 7])
def test_a_provider_without_a_page_to_sign_out_is_not_asked(tmp_path, lab: Lab, said):
    options = {
        "oidc_issuer": lab.issuer,
        "oidc_client": "bench",
        "oidc_address": "http://localhost",
    }
    before = lab.about
    lab.about = {"end_session_endpoint": said}
    try:
        with open_door(tmp_path, scene=False, **options, **GROUPS) as door, door.client() as client:
            client.get(way(door, client))
            answer = sign_out(client)
            assert answer.status_code == 303 and answer.headers["location"] == "/login"
    finally:
        lab.about = before


OTHER = RSAKey.generate_key(2048, {"kid": "one"})
NOW = int(time.time())


@pytest.mark.parametrize(
    ("lie", "text"),
    [
        ({"lies": {"nonce": "another"}}, "nonce"),
        ({"lies": {"nonce": None}}, "nonce"),
        ({"lies": {"aud": "another"}}, "aud"),
        ({"lies": {"aud": ["bench", "another"]}}, "azp"),
        ({"lies": {"aud": ["bench", "another"], "azp": "another"}}, "azp"),
        ({"lies": {"iss": "https://another.example"}}, "iss"),
        ({"lies": {"exp": NOW - 120}}, "expired"),
        ({"lies": {"exp": None}}, "exp"),
        ({"lies": {"iat": NOW + 3600}}, "not for now"),
        ({"lies": {"nbf": NOW + 3600}}, "not for now"),
        ({"lies": {"sub": None}}, "sub"),
        ({"lies": {"at_hash": "AAAAAAAAAAAAAAAAAAAAAA"}}, "at_hash"),
        ({"key": OTHER}, "not signed rightly"),
        ({"key": SECRET_KEY, "header": {"alg": "HS256"}}, "not signed rightly"),
        ({"claims": {"preferred_username": "lena", "groups": ["nobodies"]}}, "no role"),
        ({"claims": {"preferred_username": "lena"}}, "no role"),
        (
            {"claims": {"preferred_username": "a b<script>", "groups": ["staff"]}},
            "cannot be a name",
        ),
    ],
)
def test_an_identity_that_is_not_right_signs_nobody_in(door: Door, lab: Lab, lie, text):
    vars(lab).update(lie)
    with door.client() as client:
        answer = client.get(way(door, client))
        assert answer.status_code == 403 and text in answer.text, answer.text
        assert client.get("/api/me").status_code == 401
        [said] = door.front.gate.audit.newest(1)
        assert said.result == "refused" and said.what == "sign-in"


def test_clocks_may_differ_by_a_little(door: Door, lab: Lab):
    lab.lies = {"exp": int(time.time()) - 20, "iat": int(time.time()) + 20}
    with door.client() as client:
        assert client.get(way(door, client)).status_code == 200


def test_a_way_back_is_good_once_and_in_its_own_browser(door: Door):
    with door.client() as client, door.client() as other:
        back = way(door, client)
        stolen = other.get(back)  # a code that somebody else is led to use, or has seen
        assert stolen.status_code == 403 and "another browser" in stolen.text
        assert client.get(back).status_code == 200
        assert client.get(back).status_code == 403
    with door.client() as client:
        back = way(door, client)
        code = parse_qs(urlsplit(back).query)["code"][0]
        state = re.sub(r"state=[^&]+", "state=other", back)
        assert client.get(state).status_code == 403
        assert client.get(back).status_code == 200
        again = way(door, client).replace("code=", "code=x&other=")
        replayed = re.sub(r"code=x", f"code={code}", again)
        answer = client.get(replayed)  # a code that was used, in a new attempt
        assert answer.status_code == 403 and "invalid_grant" in answer.text
    with door.client() as client:
        back = way(door, client).replace("iss=http", "iss=https")
        assert client.get(back).status_code == 403


@pytest.mark.parametrize(
    "wanted",
    [
        "https://evil.example/",
        "//evil.example",
        "/\\evil.example",
        "javascript:alert(1)",
        "/logout",
    ],
)
def test_it_leads_to_pages_of_ours_only(door: Door, wanted):
    with door.client() as client:
        page = client.get(way(door, client, wanted))
        assert 'content="0;url=/"' in page.text and "evil" not in page.text


def test_what_the_provider_says_of_itself_is_checked(tmp_path, lab):
    options = {"oidc_issuer": lab.issuer, "oidc_client": "b", "oidc_address": "http://localhost"}
    before = dict(vars(lab))
    try:
        for about, text in (
            ({"issuer": "https://another.example"}, "calls itself"),
            ({"token_endpoint": "http://another.example/token"}, "want https"),
            ({"authorization_endpoint": "javascript:x"}, "want https"),
            ({"jwks_uri": f"{lab.issuer}/none"}, "says no (404"),
        ):
            lab.about = about
            with open_door(tmp_path, scene=False, **options, **GROUPS) as door:
                with door.client() as client:
                    answer = client.get("/login/provider")
                    assert answer.status_code == 503 and text in answer.text
    finally:
        vars(lab).update(before)


def test_a_provider_that_is_gone_is_said_and_local_users_get_in(tmp_path):
    options = {"oidc_issuer": "http://127.0.0.1:1/lab", "oidc_client": "b"}
    with open_door(
        tmp_path, scene=False, oidc_address="http://localhost", **options, **GROUPS
    ) as door:
        with door.client() as client:
            answer = client.get("/login/provider")
            assert answer.status_code == 503 and "does not answer" in answer.text
        with door.client("otto") as client:
            assert client.get("/api/me").status_code == 200


def test_a_refusal_there_and_a_local_user_of_that_name_are_said(door: Door):
    with door.client() as client:
        state = parse_qs(urlsplit(way(door, client)).query)["state"][0]
        answer = client.get("/login/provider/back", params={"state": state, "error": "<b>no</b>"})
        assert answer.status_code == 403 and "says no" in answer.text
        add_user(door.settings.users, "lena@lab", "seven grey herons wade", "admin")
        try:
            answer = client.get(way(door, client))
            assert answer.status_code == 403 and "own" in answer.text
        finally:
            remove_user(door.settings.users, "lena@lab")


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"oidc_client": ""}, "oidc_client"),
        ({"oidc_issuer": "http://id.example.org"}, "https"),
        ({"oidc_address": "http://bench.example.org"}, "https"),
        (dict.fromkeys(GROUPS, []), "role"),
    ],
)
def test_half_a_provider_is_no_setting(wrong, text):
    whole = {"oidc_issuer": "https://id.example.org", "oidc_client": "bench"}
    whole |= {"oidc_address": "https://bench.example.org", **GROUPS}
    assert DashboardSettings(**whole).oidc_client == "bench"
    with pytest.raises(ValueError, match=text):
        DashboardSettings(**whole | wrong)

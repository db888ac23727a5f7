"""Served pages answer whom they should, obey whom they should, and nobody makes them grow."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import os
import re
import socket
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pages import PAUSE, Answer, close_code, facts, get, page_url
from properties import examples
from pydantic import ValidationError
from tornado.websocket import websocket_connect

import wbc
from wbc.app import cli
from wbc.app.address import Address, PortError, ServedAddress
from wbc.app.view.controls import LiveControls
from wbc.app.view.guard import PageServer
from wbc.app.view.meshcat_view import MeshcatView
from wbc.app.view.server import PageMessage
from wbc.core.errors import InputError
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial


@pytest.fixture(scope="module")
def plant() -> wbc.Plant:
    return wbc.Plant(wbc.load_robot("hrp4_class"))


@pytest.fixture(scope="module")
def view(plant: wbc.Plant) -> Iterator[MeshcatView]:
    with MeshcatView(plant, port=0, rate=1e6) as view:
        yield view


# ---- who is answered ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/", "/main.min.js", "/stream", "/nothing"])
def test_requests_for_another_site_are_refused(view: MeshcatView, path: str) -> None:
    port = urlsplit(view.url).port
    for host in (
        "evil.example",
        f"evil.example:{port}",
        f"localhost.evil.example:{port}",
        f"127.0.0.1.nip.io:{port}",
        f"{os.uname().nodename}:{port}",
        f"127.0.0.2:{port}",
        f"127.0.0.1:{port}0",
        "127.0.0.1",
    ):
        for headers in ({"Host": host}, {"Host": host, "Origin": f"http://{host}"}):
            answer = get(view.url, path, **headers)
            assert answer.status == 403 and b"link" in answer.body, host
    for origin in ("http://evil.example", "null", "http://127.0.0.1", f"https://127.0.0.1:{port}"):
        assert get(view.url, path, Origin=origin).status == 403, origin
    expected = {"/stream": 400, "/nothing": 404}.get(path, 200)  # no WebSocket was asked for
    for host in (f"127.0.0.1:{port}", f"localhost:{port}", f"LOCALHOST:{port}", f"[::1]:{port}"):
        assert get(view.url, path, Host=host, Origin=f"http://{host}").status == expected, host


def test_a_rebound_name_cannot_give_orders(view: MeshcatView) -> None:
    evil = f"evil.example:{urlsplit(view.url).port}"
    path = "/stream?" + urlsplit(view.url).query
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    upgrade["Sec-WebSocket-Key"] = "A" * 22 + "=="
    for headers in (
        {"Host": evil, "Origin": f"http://{evil}"},
        {"Host": evil, "Origin": f"http://{evil}", "Sec-Fetch-Site": "same-origin"},
        {"Origin": f"http://{evil}"},
        {"Origin": f"http://{evil}", "Sec-Fetch-Site": "same-origin"},
    ):
        assert get(view.url, path, **upgrade, **headers).status == 403
    assert get(view.url, path, **upgrade).status == 101


def test_addresses_answer_to_their_names_and_no_others() -> None:
    here = os.uname().nodename.lower()
    everywhere = f"http://{os.uname().nodename}:7000/"
    for host, bound, port, url, admitted, refused in (
        (
            *("127.0.0.1", "127.0.0.1", 7000, "http://127.0.0.1:7000/"),
            "127.0.0.1:7000 localhost:7000 [::1]:7000",
            f"{here}:7000 127.0.0.1:7001 127.0.0.1: 127.0.0.1 :7000 ::1:7000 u@localhost:7000",
        ),
        (
            *("::1", "::1", 7000, "http://[::1]:7000/"),
            "[::1]:7000 localhost:7000",
            "::1:7000 [::2]:7000 [::1]",
        ),
        (
            *("0.0.0.0", "0.0.0.0", 7000, everywhere),
            f"{here}:7000 192.0.2.1:7000 [2001:db8::1]:7000 localhost:7000",
            f"evil.example:7000 192.0.2.1:80 {here}.evil.example:7000 192.0.2:7000 2001:db8::1:7000",
        ),
        (
            *("robot.example", "192.0.2.7", 80, "http://robot.example:80/"),
            "Robot.Example 192.0.2.7 robot.example:80",
            "robot.example:8080 example 192.0.2.8",
        ),
    ):
        served = ServedAddress(host, bound, port)
        assert served.url == url
        assert [name for name in admitted.split() if not served.admits(name)] == []
        assert [name for name in ("", *refused.split()) if served.admits(name)] == []
    assert ServedAddress("0", "0.0.0.0", 7000).everywhere  # what is meant counts, not how it is written


@pytest.mark.parametrize("host", ["", " ", "a b", "127.0.0.1\0", "a" * 64, "a..b", "\ud800", "x\n"])
def test_hosts_that_name_nothing_are_refused(host: str) -> None:
    with pytest.raises(InputError, match=re.escape(repr(host))):
        Address(host)


@pytest.mark.parametrize("command", [["stand", "--view"], ["walk", "--view"], ["view", "none.arrow"]])
@pytest.mark.parametrize(("option", "value"), [("--host", ""), ("--port", "70000"), ("--port", "-1")])
def test_commands_refuse_addresses_in_one_line(
    command: list[str], option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*command, f"{option}={value}"]) == cli.BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    assert option.strip("-") in captured.err and (value or "''") in captured.err


def test_an_unknown_host_is_asked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def unknown(address: Any, **_: Any) -> Any:
        asked.append(address)
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "create_server", unknown)
    with pytest.raises(PortError, match=r"at nowhere\.example: Name or service not known$"):
        PageServer("replay", Address("nowhere.example"))
    assert len(asked) == 1


# ---- who is obeyed --------------------------------------------------------------------------------------------------


def test_the_token_is_in_the_link_alone(view: MeshcatView) -> None:
    token = urlsplit(view.url).query.removeprefix("token=")
    assert len(base64.urlsafe_b64decode(token + "==")) >= 16
    assert token.encode() not in get(view.url).body  # the page is for everybody


@pytest.mark.parametrize("query", ["", "?token=", "?token=wrong", "?token=%E2%82%AC", "{right}x", "?other=1"])
def test_who_has_not_the_link_watches_and_is_not_obeyed(view: MeshcatView, query: str) -> None:
    async def order() -> tuple[dict[str, Any], int | None]:
        address = page_url(view, "stream", token=False) + query.format(right="?" + urlsplit(view.url).query)
        page = await websocket_connect(address)
        hello = await facts(page, lambda said: "hello" in said)
        await facts(page, lambda said: "time" in said)
        await page.write_message(PAUSE)
        return hello, await close_code(page)

    view.update()
    hello, code = asyncio.run(order())
    assert hello["hello"]["may_change"] is False and code == 1008
    view.update()  # would wait
    assert view.interventions == []


def test_a_pause_ends_with_the_last_page_that_could_end_it(view: MeshcatView) -> None:
    async def both() -> None:
        watching = await websocket_connect(page_url(view, "stream", token=False))
        pausing = await websocket_connect(page_url(view, "stream"))
        assert (await facts(pausing, lambda said: "hello" in said))["hello"]["may_change"] is True
        await pausing.write_message(PAUSE)
        await facts(watching, lambda said: said.get("paused") is True)
        pausing.close()
        await close_code(pausing)
        await facts(watching, lambda said: said.get("paused") is False)
        async with asyncio.timeout(20.0):
            while view.pages != 1:
                await asyncio.sleep(0.01)
        watching.close()
        await close_code(watching)

    asyncio.run(both())


# ---- what is obeyed -------------------------------------------------------------------------------------------------


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.just(10**400),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)

NAMES = st.sampled_from(["push", "stop", "gain", "stiffness", "left", "dcm_p", "cop_admittance"])

ORDERS = st.fixed_dictionaries(
    {"do": NAMES | JSON_VALUES},
    optional={name: NAMES | JSON_VALUES for name in ("direction", "impulse", "name", "value")},
)


@pytest.fixture(scope="module")
def trial() -> WalkTrial:
    return WalkTrial(WalkSpec(foot="variable", timestep=0.0025))


@examples(30)
@given(order=ORDERS | JSON_VALUES)
def test_no_order_raises_in_the_control_loop(trial: WalkTrial, order: Any) -> None:
    controls = LiveControls(trial.plant, trial.walking)
    controls.apply(order)  # however it has got there
    with contextlib.suppress(ValidationError):
        controls.apply(PageMessage.model_validate_json(json.dumps({"order": order})).order)
    assert controls.message


def test_whatever_fails_in_an_order_is_said_and_the_run_goes_on(
    trial: WalkTrial, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: Any) -> None:
        raise ZeroDivisionError("of all things")

    monkeypatch.setattr(trial.plant, "push", fail)
    controls = LiveControls(trial.plant, trial.walking)
    controls.apply({"do": "push", "direction": "left", "impulse": 0.1})
    assert controls.message == "refused: of all things" and controls.interventions == []
    assert "ZeroDivisionError" in caplog.text


# ---- what a page may do ---------------------------------------------------------------------------------------------


def policy(answer: Answer) -> dict[str, list[str]]:
    text = answer.headers["Content-Security-Policy"]
    return {name: values for name, *values in (rule.split() for rule in text.split(";"))}


def test_a_page_runs_its_own_scripts_and_no_others(view: MeshcatView) -> None:
    nonces = set()
    for _ in range(2):
        answer = get(view.url)
        rules, page = policy(answer), answer.body.decode()
        assert rules["frame-ancestors"] == rules["default-src"] == rules["base-uri"] == ["'none'"]
        (script,) = rules["script-src"]
        nonces.add(script)
        scripts = re.findall(r"<script\b([^>]*)>", page)
        assert len(scripts) == 2
        for attributes in scripts:
            assert re.findall(r'nonce="([^"]+)"', attributes) == [script[len("'nonce-") : -1]]
        assert not re.search(r"<[^>]+\son[a-z]+=", re.sub(r"<script.*?</script>", "", page, flags=re.S))
        assert f"ws://127.0.0.1:{urlsplit(view.url).port}" in rules["connect-src"]
    assert len(nonces) == 2


@pytest.mark.parametrize("path", ["/", "/main.min.js", "/nothing"])
def test_nothing_is_framed_or_embedded(view: MeshcatView, path: str) -> None:
    for headers in ({}, {"Host": "evil.example"}):
        answer = get(view.url, path, **headers)
        assert policy(answer)["frame-ancestors"] == ["'none'"]
        assert answer.headers["X-Frame-Options"] == "DENY"
        assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert answer.headers["Referrer-Policy"] == "no-referrer"

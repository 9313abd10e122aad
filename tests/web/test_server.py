"""Where the page binds and whom it answers."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest


def own_address() -> str:
    """An address of this machine that is not the loopback's; nothing is sent to find it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        try:
            s.connect(("192.0.2.1", 9))
            return str(s.getsockname()[0])
        except OSError:
            return "127.0.0.1"


@pytest.fixture(scope="module")
def local(serve: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(serve(tmp_path_factory.mktemp("local")).url)


@pytest.fixture(scope="module")
def shared(serve: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> str:
    served = serve(tmp_path_factory.mktemp("shared"), "--host", "0.0.0.0")
    return str(served.url)


def test_it_is_for_this_machine_alone(local: str) -> None:
    port = int(local.rsplit(":", 1)[1].strip("/"))
    assert httpx.get(local).status_code == 200
    address = own_address()
    with socket.socket() as trial:
        trial.settimeout(2)
        reached = trial.connect_ex((address, port)) == 0
    assert reached == address.startswith("127.")


@pytest.mark.parametrize(
    "headers", [{"host": "evil.example"}, {"origin": "http://evil.example"}, {"host": "evil.example:8750"}]
)
def test_no_other_site_may_talk_to_it(local: str, headers: dict[str, str]) -> None:
    assert httpx.get(local, headers=headers).status_code == 403


def test_no_other_site_may_open_its_socket(local: str) -> None:
    upgrade = {
        "connection": "Upgrade", "upgrade": "websocket", "sec-websocket-version": "13",
        "sec-websocket-key": "dGhlIHNhbXBsZSBub25jZQ==",
    }  # fmt: skip
    path = f"{local}_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    assert httpx.get(path, headers={**upgrade, "origin": "http://evil.example"}).status_code == 403


@pytest.mark.parametrize(
    "path", ["../../etc/passwd", "_nicegui/../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "static/../pyproject.toml"]
)
def test_no_file_can_be_fetched(local: str, path: str) -> None:
    answer = httpx.get(local + path)
    assert answer.status_code == 404 or "root:" not in answer.text


@pytest.mark.parametrize(("path", "status"), [("", 200), ("compare", 200), ("nothing", 404), ("static/x", 404)])
def test_every_response_forbids_frames_and_foreign_content(local: str, path: str, status: int) -> None:
    refused = httpx.get(local + path, headers={"host": "evil.example"})
    answer = httpx.get(local + path)
    assert (answer.status_code, refused.status_code) == (status, 403)
    for headers in (answer.headers, refused.headers):
        assert headers.get_list("x-frame-options") == ["DENY"]
        assert headers.get_list("x-content-type-options") == ["nosniff"]
        assert headers.get_list("referrer-policy") == ["no-referrer"]
        (policy,) = headers.get_list("content-security-policy")
        parts = dict(part.split(" ", 1) for part in policy.split("; "))
        assert parts["frame-ancestors"] == "'none'"
        assert parts["default-src"] == "'self'"
        assert not any("*" in part or "http" in part for part in parts.values())


def test_no_page_can_frame_it(local: str, chromium: Any) -> None:
    page = chromium.new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.set_content(f"<iframe src='{local}'></iframe>")
    while not any("frame" in text.lower() for text in said):
        page.wait_for_timeout(50)
    assert "gyrocal" not in (page.frames[1].content() if len(page.frames) > 1 else "")
    page.close()


def test_the_page_reaches_no_other_server(local: str, chromium: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"http://127.0.0.1:{other.getsockname()[1]}/"
        page = chromium.new_page()
        page.goto(local)
        page.evaluate("address => fetch(address).catch(() => 0)", address)
        image = "address => new Promise(done => { const image = new Image(); image.onerror = done; image.src = address; })"
        page.evaluate(image, address)
        page.close()
        other.setblocking(False)
        with pytest.raises(BlockingIOError):
            other.accept()


def test_beyond_this_machine_a_token_is_asked_for(shared: str) -> None:
    here = httpx.URL(shared).copy_with(host="127.0.0.1")
    base, token = str(here).split("?token=")
    assert len(token) >= 20
    for url in (base, f"{base}?token=wrong", f"{base}compare", f"{base}_nicegui_ws/socket.io/?EIO=4&transport=polling"):
        assert httpx.get(url).status_code == 403, url
    with httpx.Client(follow_redirects=True) as client:
        answer = client.get(here)
        assert answer.status_code == 200
        assert "token" not in str(answer.url)
        cookie = answer.history[0].headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert client.get(f"{base}compare").status_code == 200


def test_a_port_in_use_is_one_line(local: str, tmp_path: Path) -> None:
    port = local.rsplit(":", 1)[1].strip("/")
    done = subprocess.run(
        [sys.executable, "-m", "gyrocal", "workbench", "--no-browser", "--http-port", port],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert port in done.stderr


def test_no_session_is_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "gyrocal", "workbench", "nothing", "--no-browser"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "no such file" in done.stderr


def test_the_first_page_waits_for_no_heavy_import() -> None:
    heavy = ("numpy", "scipy", "polars", "matplotlib", "onnxruntime", "torch")
    wanted = ("web import page, server", "web.state import workbench", "web.panels import start")
    lines = ["import sys", *(f"from gyrocal.{what}" for what in wanted)]
    done = subprocess.run(
        [sys.executable, "-c", "; ".join([*lines, f"print([m for m in {heavy} if m in sys.modules])"])],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "[]\n"

"""What the server refuses: other hosts, other origins, callers without the token, paths, and too much."""

from __future__ import annotations

import http.client
import json
import secrets
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from tests.served.server import Server, serving
from tests.unlisted import unlisted

from fourpole.served.workspace import Workspace


def files_below(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if "cache" not in path.parts}


@pytest.mark.sampled(2)
def test_every_answer_has_the_policy(server: Server) -> None:
    for path in ("/", "/static/app.js", "/nowhere", "/c/nothing"):
        _, _, headers = server.ask(path)
        policy = headers["content-security-policy"]
        assert "script-src 'self';" in policy
        assert "unsafe-eval" not in policy
        for name in ("object-src", "base-uri", "frame-ancestors"):
            assert f"{name} 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "10.0.0.1", "", "[::1", "evil.example@127.0.0.1"],
)
def test_another_host_is_refused(server: Server, host: str) -> None:
    assert server.ask("/", headers={"Host": host})[0] == 421


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example", "Sec-Fetch-Site": "cross-site"},
        {"Origin": "null"},
        {"Origin": "http://localhost:1"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {},
    ],
)
def test_another_site_can_change_nothing(server: Server, headers: dict[str, str]) -> None:
    key = "radial-and-cross~"
    for method, path in (
        ("POST", "/upload"), ("POST", "/demo"), ("PUT", f"/c/{key}/statement"), ("POST", f"/c/{key}/run"),
    ):  # fmt: skip
        assert server.ask(path, method, {}, headers=headers, own=False)[0] == 403


def test_another_site_cannot_use_an_answer(server: Server) -> None:
    assert server.ask("/", headers={"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, own=False)[0] == 403
    opened = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
    assert server.ask("/", headers=opened, own=False)[0] == 200


@pytest.mark.parametrize(
    "path",
    [
        "/c/..",
        "/c/../../etc/passwd",
        "/c/%2e%2e%2f%2e%2e",
        "/static/../guard.py",
        "/static/%2e%2e%2fguard.py",
        "/c/%00",
        "/c/radial and cross/files/campaign.toml".replace(" ", "%20"),
    ],
)
def test_a_path_leads_nowhere(server: Server, path: str) -> None:
    status, content, _ = server.ask(path)
    assert status in (400, 404)
    assert b"root:" not in content
    assert b"Traceback" not in content


def test_only_files_of_the_report_are_given(server: Server) -> None:
    address = campaign_address(server)
    assert server.ask(f"{address}/files/report.html")[0] == 200
    for name in ("study.json", "..%2Fcampaign.toml", "../campaign.toml", "%2Fetc%2Fpasswd"):
        assert server.ask(f"{address}/files/{name}")[0] in (400, 404)


def campaign_address(server: Server) -> str:
    page = server.ask("/")[1].decode()
    start = page.index('href="/c/') + len('href="')
    return page[start : page.index('"', start)]


def test_text_of_a_campaign_stays_text(server: Server, analysed: Path) -> None:
    folder = server.root / "hostile <b>bold<b>"
    shutil.copytree(analysed, folder, ignore=shutil.ignore_patterns("results"))
    text = (folder / "campaign.toml").read_text()
    (folder / "campaign.toml").write_text(text.replace("title = ", 'title = "<script>alert(1)</script>" #', 1))
    tests = (folder / "tests.csv").read_text()
    (folder / "tests.csv").write_text(tests.replace("S1,", "</script><img src=x onerror=alert(1)>,", 1))
    try:
        for part in ("", "/statement", "/tests", "/run"):
            page = server.ask("/" if not part else f"{hostile_address(server)}{part}")[1].decode()
            assert "<script>alert" not in page
            assert "<img src=x" not in page
            assert "<b>bold" not in page
    finally:
        shutil.rmtree(folder)


def hostile_address(server: Server) -> str:
    page = server.ask("/")[1].decode()
    start = page.index('href="/c/hostile') + len('href="')
    return page[start : page.index('"', start)]


class TestUploads:
    """Files that should not come."""

    @pytest.mark.sampled(2)
    def test_they_become_a_campaign(self, server: Server, analysed: Path) -> None:
        recordings = sorted((analysed / "recordings").glob("*.csv"))[:4]
        ticket = begin(server, "new <one>", [(path.name, path.stat().st_size) for path in recordings])
        for number, path in enumerate(recordings):
            assert server.ask(f"/upload/{ticket}/{number}", "PUT", path.read_bytes())[0] == 200
        following = server.document(f"/upload/{ticket}", "POST")["next"]
        assert following.endswith("/run")
        folder = server.root / "new -one"
        wait_for(folder / "tests.csv")
        assert (folder / recordings[0].name).read_bytes() == recordings[0].read_bytes()
        assert not list(server.root.glob(".fourpole-upload-*"))
        shutil.rmtree(folder)

    @pytest.mark.parametrize(
        "name", [
            "half \ud800.csv", "a\x00.csv", "CON", "con.txt", "lpt1.csv", "a/NUL.csv", "..\\a.csv", "C:\\a.csv", "..",
            "\\\\h\\s", "ü" * 128, ".a", "a/.b/c", "a ", "a.", "a./b.csv", "a\x1b[2J.csv", "a\u202ecsv.exe", "a\n.csv",
            "A.CSV", "a.csv/b.csv", "x" * 100_000,
        ],
    )  # fmt: skip
    def test_a_bad_name_is_told_and_the_other_files_go_on(self, server: Server, name: str) -> None:
        files, called = [{"name": one, "size": 3} for one in ("a.csv", name, "b.csv")], secrets.token_hex(8)
        asked = server.document("/upload", "POST", {"name": called, "files": files})
        assert list(asked["refused"]) == ["1"]
        assert "rename" in asked["refused"]["1"]
        assert len(asked["refused"]["1"]) < 200
        ticket = asked["ticket"]
        assert server.ask(f"/upload/{ticket}/1", "PUT", b"abc")[0] == 400
        for number in (0, 2):
            assert server.ask(f"/upload/{ticket}/{number}", "PUT", b"abc")[0] == 200
        server.document(f"/upload/{ticket}", "POST")
        assert {path.name for path in (server.root / called).glob("*.csv")} >= {"a.csv", "b.csv"}
        assert {path.name for path in (server.root / called).rglob("*")} <= {
            "a.csv",
            "b.csv",
            "campaign.toml",
            "tests.csv",
        }
        server.ask(f"/c/{called}/run", "DELETE")
        shutil.rmtree(server.root / called, ignore_errors=True)

    @pytest.mark.parametrize(
        ("name", "folder"),
        [
            ("CON", "campaign CON"), ("results", "campaign results"), ("..\\a", "a"), ("half \ud800", "half"),
            ("轮" * 100, "轮" * 26), ("a. ", "a"), ("", "campaign"), ("/etc/x", "etc-x"),
        ],
    )  # fmt: skip
    def test_the_name_of_a_campaign_is_made_fit(self, tmp_path: Path, name: str, folder: str) -> None:
        assert Workspace(tmp_path).new_folder(name) == tmp_path / folder

    @pytest.mark.parametrize(
        "name",
        [
            "../out.csv", "/etc/out.csv", "a/../../out.csv", "..\\out.csv", "a\x00b.csv", "", ".hidden", "a/./b",
            "x" * 300, "a:b.csv", "/".join("abcdefghijk"),
        ],
    )  # fmt: skip
    @pytest.mark.sampled(2)
    def test_a_name_that_is_a_path_is_refused(self, server: Server, name: str) -> None:
        before = files_below(server.root.parent)
        status, content, _ = server.ask("/upload", "POST", {"name": "x", "files": [{"name": name, "size": 1}]})
        assert status == 400
        assert "cannot be the name" in json.loads(content)["error"]
        assert files_below(server.root.parent) == before

    def test_too_many_and_too_much_are_refused(self, server: Server) -> None:
        files = [{"name": f"{at}.csv", "size": 1} for at in range(20_000)]
        status, content, _ = server.ask("/upload", "POST", {"name": "many", "files": files})
        assert status == 400
        assert "at most 10000" in json.loads(content)["error"]
        large = {"name": "large", "files": [{"name": "a.csv", "size": 3 * 1024**3}]}
        assert server.ask("/upload", "POST", large)[0] == 400
        assert server.ask("/upload", "POST", b"[" * 100_000)[0] == 400
        assert not list(server.root.glob(".fourpole-upload-*"))

    def test_a_file_larger_than_announced_leaves_nothing(self, server: Server) -> None:
        ticket = begin(server, "grows", [("a.csv", 10)])
        assert server.ask(f"/upload/{ticket}/0", "PUT", b"x" * 11)[0] == 400
        assert server.ask(f"/upload/{ticket}/1", "PUT", b"x")[0] == 400
        assert server.ask(f"/upload/{ticket}", "POST")[0] == 400
        server.ask(f"/upload/{ticket}", "DELETE")
        assert not list(server.root.glob(".fourpole-upload-*"))
        assert not (server.root / "grows").exists()

    def test_one_cut_half_way_leaves_nothing(self, server: Server) -> None:
        ticket = begin(server, "cut", [("a.csv", 1_000_000)])
        there = urlsplit(server.address)
        connection = http.client.HTTPConnection(there.hostname or "", there.port)
        connection.putrequest("PUT", f"/upload/{ticket}/0")
        connection.putheader("Origin", f"http://{there.netloc}")
        connection.putheader("Content-Length", "1000000")
        connection.endheaders(b"half")
        connection.close()
        hidden = next(server.root.glob(".fourpole-upload-*"))
        for _ in range(50):
            if not list(hidden.rglob("*.csv")):
                break
            time.sleep(0.1)
        assert not list(hidden.rglob("*.csv"))
        server.ask(f"/upload/{ticket}", "DELETE")
        assert not hidden.exists()

    @pytest.mark.thorough
    @pytest.mark.sampled(4)
    def test_uploads_of_a_former_server_are_deleted(self, tmp_path: Path) -> None:
        (tmp_path / ".fourpole-upload-old").mkdir()
        with serving(tmp_path) as running:
            begin(running, "left", [("a.csv", 5)])
        assert not list(tmp_path.iterdir())


def begin(server: Server, name: str, files: list[tuple[str, int]]) -> str:
    listed = [{"name": one, "size": size} for one, size in files]
    ticket: str = server.document("/upload", "POST", {"name": name, "files": listed})["ticket"]
    return ticket


def wait_for(path: Path, seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not path.exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert path.exists()


class TestToken:
    """Who does not know the address as it was printed: another account of the machine, another machine."""

    @pytest.mark.parametrize("method", ["GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS"])
    @pytest.mark.parametrize(
        "path", ["/", "/c/radial", "/static/app.js", "/compare", "/upload", "/c/x/run/events", "/c/x/tests/D1/signals"]
    )
    def test_nothing_is_answered_without_it(self, server: Server, method: str, path: str) -> None:
        for headers in ({}, {"Cookie": f"{server.cookie[0]}=wrong"}, {"Cookie": f"fourpole={server.token}"}):
            assert server.ask(path, method, headers=headers, known=False)[0] == 401

    def test_a_refused_page_says_where_the_address_stands(self, server: Server) -> None:
        for headers in ({}, {"Accept": "*/*"}, {"X-Asked-By": "script"}):
            status, content, answered = server.ask("/c/x", headers=headers, known=False)
            assert status == 401
            assert b"in the terminal where" in content
            assert server.token not in f"{content.decode()}{answered}"
        assert json.loads(content)["error"].startswith("this needs the whole address")

    @pytest.mark.parametrize(
        ("asked", "target"),
        [
            ("/?token=", "/"),
            ("/c/a~1/tests/D%2F1?from=1&token=&to=%2B2", "/c/a~1/tests/D%2F1?from=1&to=%2B2"),
            ("/x?token=1&token=", "/x"),
            ("//evil.example/x?token=", "/evil.example/x"),
            ("/\\evil.example/x?token=", "/evil.example/x"),
        ],
    )
    def test_it_leads_to_the_same_page_without_it(self, server: Server, asked: str, target: str) -> None:
        for method in ("GET", "HEAD"):
            status, _, headers = server.ask(asked.replace("token=", f"token={server.token}"), method, known=False)
            assert (status, headers["location"]) == (303, target)
            assert headers["set-cookie"].startswith("=".join(server.cookie))
            assert headers["cache-control"] == "no-store"
            assert headers["referrer-policy"] == "no-referrer"
        status, _, headers = server.ask(asked.replace("token=", "token=old"))
        assert (status, headers["location"]) == (303, target)  # of somebody who is known already
        assert "set-cookie" not in headers

    def test_another_site_cannot_make_use_of_it(self, server: Server) -> None:
        """A page of another site may lead to a page; the browser sends the cookie then, and the site sees no answer."""
        evil = {"Origin": "http://evil.example", "Sec-Fetch-Site": "cross-site"}
        for method in ("POST", "PUT", "DELETE"):
            assert server.ask("/c/x/run", method, headers=evil, own=False)[0] == 403
        assert server.ask("/", headers={**evil, "Sec-Fetch-Mode": "cors"}, own=False)[0] == 403
        assert server.ask("/static/app.js", headers={"Sec-Fetch-Site": "same-site"}, own=False)[0] == 403

    @pytest.mark.sampled(2)
    def test_cookies_of_other_servers_do_not_matter(self, server: Server, empty_server: Server) -> None:
        other = empty_server
        assert server.cookie[0] != other.cookie[0]
        assert server.token != other.token
        both = "; ".join("=".join(one) for one in (server.cookie, other.cookie))
        for one in (server, other):
            assert one.ask("/", headers={"Cookie": both})[0] == 200
        tossed = f"{server.cookie[0]}=x; a=b; {'='.join(server.cookie)}; {server.cookie[0]}="
        assert server.ask("/", headers={"Cookie": tossed})[0] == 200
        assert server.ask("/", headers={"Cookie": f"{other.cookie[0]}={server.token}"})[0] == 401

    @pytest.mark.thorough
    @pytest.mark.sampled(4)
    def test_who_wants_none_says_so(self, tmp_path: Path) -> None:
        with serving(tmp_path, "--no-token") as running:
            assert "token" not in running.address
            assert running.ask("/", known=False)[0] == 200
            assert running.ask("/upload", "POST", {}, headers={"Origin": "null"}, own=False, known=False)[0] == 403

    @pytest.mark.thorough
    @pytest.mark.sampled(4)
    def test_it_is_needed_once(self, tmp_path: Path) -> None:
        with serving(tmp_path, "--host", "0.0.0.0") as running:
            port, token = urlsplit(running.address).port, urlsplit(running.address).query.removeprefix("token=")
            local = Server(f"http://127.0.0.1:{port}", tmp_path, tmp_path)  # which does not know it
            assert len(token) > 20
            assert local.ask("/")[0] == 401
            assert local.ask("/?token=wrong")[0] == 401
            assert local.ask("/static/app.js")[0] == 401
            assert local.ask("/upload?token=" + token, "POST", {})[0] == 401
            assert local.ask("/", headers={"Host": "evil.example"})[0] == 421
            status, _, headers = local.ask(f"/?token={token}")
            assert (status, headers["location"]) == (303, "/")
            assert "HttpOnly" in headers["set-cookie"]
            assert "SameSite=lax" in headers["set-cookie"]
            cookie = headers["set-cookie"].split(";")[0]
            assert local.ask("/", headers={"Cookie": cookie})[0] == 200


@pytest.mark.parametrize("form", [{"command": ["analyse"]}, {"command": {}}, {"command": "fit", "options": 5}, [], 7])
def test_what_is_no_command_is_refused(server: Server, form: object) -> None:
    key = server.ask("/")[1].decode().split('href="/c/')[1].split('"')[0]
    assert server.ask(f"/c/{key}/run", "POST", form)[0] == 400


@pytest.fixture
def one(server: Server, analysed: Path) -> Iterator[Path]:
    """A further campaign of the server, for one test; its address is /c/one."""
    folder = server.root / "one"
    shutil.copytree(analysed, folder)
    yield folder
    shutil.rmtree(folder)


@pytest.mark.parametrize("linked", ["campaign.toml", "results", "results/figures", "results/dynamic.csv"])
def test_a_link_that_leads_out_is_not_followed(server: Server, one: Path, tmp_path: Path, linked: str) -> None:
    (one / linked).rename(tmp_path / "outside")
    (one / linked).symlink_to(tmp_path / "outside")
    assert b"/c/one" not in server.ask("/")[1]
    assert {server.ask(f"/c/one{part}")[0] for part in ("", "/statement", "/tests/D1")} == {404}


def test_a_statement_that_cannot_be_read_is_told_on_every_page(server: Server, one: Path) -> None:
    toml = one / "campaign.toml"
    toml.write_text("title = 'x\n" + toml.read_text())
    for part in ("", "/explore", "/tests", "/tests/D1", "/model", "/plan", "/run", "/watch"):
        answer = server.ask(f"/c/one{part}")[1]
        assert b'href="/c/one/statement">' in answer.partition(b"<main")[2], part
    page = server.ask("/c/one/statement")[1]
    assert page.count(b"not valid TOML") == 1
    assert b'<details class="text" open>' in page


def test_a_table_that_cannot_be_read_is_told_with_the_tests(server: Server, one: Path) -> None:
    (one / "tests.csv").write_text("test,file,kind,tyre\n")
    assert b"lists no test" in server.ask("/c/one/tests")[1]
    assert b"lists no test" in server.ask("/c/one/statement")[1]


def test_a_figure_that_is_no_text_is_shown_as_it_is(server: Server, one: Path) -> None:
    for path in (one / "results" / "figures").glob("*.svg"):
        path.write_bytes(b"\xff\xfe<svg onload='alert(1)'><script>alert(2)</script>")
    for part in ("", "/tests", "/model"):
        status, content, _ = server.ask(f"/c/one{part}")
        assert status == 200
        assert b"alert(" not in content


def test_results_of_another_version_are_told(server: Server, one: Path) -> None:
    table = unlisted(one / "results") / "dynamic.csv"
    table.write_text(table.read_text().replace("loss factor [1]", "eta"))
    (one / "results" / "study.json").touch()
    status, content, _ = server.ask("/c/one")
    assert status == 400
    assert b"has no column &#39;loss factor [1]&#39;: run fourpole analyse again" in content
    assert b'href="/c/one/run"' in content


def test_recordings_without_a_statement_lead_to_the_first_step(server: Server, one: Path) -> None:
    for name in ("campaign.toml", "tests.csv"):
        (one / name).unlink()
    (one / "recordings" / "D1.csv").rename(one / "D1.csv")
    status, _, headers = server.ask("/c/one/statement")
    assert (status, headers["location"]) == (303, "/c/one/run")


def test_a_file_that_is_sent_twice_is_kept(server: Server) -> None:
    files = [{"name": "a.csv", "size": 3}, {"name": "a.csv/b.csv", "size": 3}]
    ticket = server.document("/upload", "POST", {"name": "one", "files": files})["ticket"]
    assert server.ask(f"/upload/{ticket}/0", "PUT", b"123")[0] == 200
    assert server.ask(f"/upload/{ticket}/0", "PUT", b"456")[0] == 400
    assert server.ask(f"/upload/{ticket}/1", "PUT", b"789")[0] == 400
    (kept,) = server.root.rglob("a.csv")
    assert kept.read_bytes() == b"123"
    server.ask(f"/upload/{ticket}", "DELETE")


@pytest.mark.parametrize("size", [1e400, "x", None])
def test_a_size_that_is_none_is_refused(server: Server, size: object) -> None:
    assert server.ask("/upload", "POST", {"name": "n", "files": [{"name": "a", "size": size}]})[0] == 400


@pytest.mark.parametrize("part", ["from=-inf", "to=inf", "from=-inf&to=inf", "from=nan", "from=1&to=0", "width=nan"])
def test_a_part_that_is_no_part_is_refused(server: Server, part: str) -> None:
    key = server.ask("/")[1].decode().split('href="/c/')[1].split('"')[0]
    assert server.ask(f"/c/{key}/tests/D1/signals?{part}")[0] == 400


def test_a_name_with_a_slash_has_a_page(server: Server, one: Path) -> None:
    table = one / "tests.csv"
    table.write_text(table.read_text().replace("\nD1,", "\nD/1,", 1))
    assert "D/1," in table.read_text()
    for part in ("", "/signals"):
        assert server.ask(f"/c/one/tests/D%2F1{part}")[0] == 200
    assert server.ask("/c/one/tests/D%2F1/excluded", "PUT", {"reason": "slipped"})[0] == 200
    assert "slipped" in table.read_text()


def test_a_script_of_a_page_is_told_why_without_an_error_of_the_browser(server: Server, one: Path) -> None:
    (one / "recordings" / "D1.csv").unlink()
    for headers, expected in (({"X-Asked-By": "script"}, 200), ({}, 400)):
        status, content, _ = server.ask("/c/one/tests/D1/signals", headers={"Accept": "*/*", **headers})
        assert status == expected
        assert "there is no such file" in json.loads(content)["error"]

"""No server is asked, and no credentials are looked up, for a URL that the user did not allow."""

import json
import os
import socket
import threading

import pytest
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.errors import FileError
from fourpole.io import child as children
from fourpole.io import remote, userfolders
from fourpole.io.processes import REMOTE
from fourpole.study.watch import Watch

pytestmark = pytest.mark.thorough

SAYS = "are read only if you allow it: by --remote"


@pytest.fixture(autouse=True)
def forgotten():
    """What a process remembers of the configuration, and a worker of its variables, is of one test."""
    yield
    remote._configured.cache_clear()
    userfolders.user_key.cache_clear()
    children.child().close(for_good=False)


@pytest.fixture
def user(tmp_path, monkeypatch):
    """The folder of the configuration of one test; the function writes config.toml."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    monkeypatch.setenv(REMOTE, "")
    remote._configured.cache_clear()
    userfolders.user_key.cache_clear()

    def write(text):
        (userfolders.config_folder() / "config.toml").write_text(text)
        remote._configured.cache_clear()

    return write


@pytest.fixture
def asked(monkeypatch):
    """Connections to a server of this machine that all of AWS is said to be: objects, credentials, tokens."""
    connections = []
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        while True:
            try:
                one, _ = listening.accept()
            except OSError:
                return
            connections.append(one.recv(200))
            one.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            one.close()

    threading.Thread(target=serve, daemon=True).start()
    here = f"http://127.0.0.1:{listening.getsockname()[1]}"
    for name in [name for name in os.environ if name.startswith("AWS_")]:
        monkeypatch.delenv(name)
    for name in ("ENDPOINT_URL", "CONTAINER_CREDENTIALS_FULL_URI", "EC2_METADATA_SERVICE_ENDPOINT"):
        monkeypatch.setenv(f"AWS_{name}", here)
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    children.child().close(for_good=False)
    yield connections
    listening.shutdown(socket.SHUT_RDWR)
    listening.close()


@pytest.fixture
def elsewhere(noisy):
    """A campaign of a customer, whose tests.csv names recordings of a server."""
    for name in ("S1", "D2", "D3"):
        noisy.edit("tests.csv", f"recordings/{name}.csv", f"s3://rig-2/warm/{name}.csv")
    return noisy


def run(*words):
    return CliRunner().invoke(app, [*map(str, words)])


COMMANDS = {"analyse": ("--tables-only", "--route", "mobility"), "check": (), "plan": ()}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.sampled(2)
def test_no_server_is_asked_and_one_message_says_what_to_do(elsewhere, user, asked, command):
    elsewhere.edit("tests.csv", "s3://rig-2/warm/S1.csv", "recordings/S1.csv")
    done = run(command, elsewhere.path, *COMMANDS[command])
    assert asked == []
    if command != "plan":
        said = " ".join(done.output.split())
        assert done.exit_code == 3
        assert said.count(SAYS) == 1, said
        assert '[remote] allow = ["s3://rig-2/"]' in said


@pytest.mark.sampled(2)
def test_neither_watch_nor_read_nor_a_second_run_asks(elsewhere, user, asked):
    Watch(elsewhere.path).warm()
    for _ in range(2):
        rejected = elsewhere.analyse(cache=elsewhere.path / "kept").counts["rejected"]
        assert rejected == 3
        assert run("analyse", elsewhere.path, "--tables-only").exit_code == 3
    assert asked == []


@pytest.mark.parametrize("image", [True, False])
def test_an_image_or_a_response_on_a_server_is_never_asked_for(noisy, user, asked, image):
    if image:
        noisy.edit("campaign.toml", "[rig]", '[report]\nlogo = "s3://rig-2/logo.png"\n\n[rig]')
    else:
        noisy.edit("campaign.toml", 'column = "F1", ', 'column = "F1", response = "s3://rig-2/f1.csv", ')
    done = run("analyse", noisy.path, "--tables-only")
    assert done.exit_code in (2, 3)
    assert "is not on this machine: copy it into the campaign folder" in done.output
    assert asked == []


@pytest.mark.sampled(3)
def test_with_the_option_the_server_is_asked(elsewhere, user, asked):
    """So the tests above can fail."""
    done = run("check", elsewhere.path, "--remote")
    assert SAYS not in done.output
    assert asked


@pytest.mark.parametrize(
    ("prefix", "url", "says"),
    [
        ("s3://", "s3://lab/a", True),
        ("S3://", "s3://lab/a", True),
        ("s3://lab", "s3://lab/a", True),
        ("s3://lab/", "s3://lab/a/b", True),
        ("s3://lab/a", "s3://lab/a/b", True),
        ("s3://lab/a/b", "s3://lab/a/b", True),
        ("s3://lab/warm%20tests/", "s3://lab/warm tests/D1.csv", True),
        ("s3://lab", "s3://lab-2/a", False),
        ("s3://lab/a", "s3://lab/ab", False),
        ("s3://lab/a/b", "s3://lab/a", False),
        ("s3://lab", "s3://other/lab/a", False),
        ("s3://LAB", "s3://lab/a", False),
        ("lab", "s3://lab/a", False),
        ("s3:", "s3://lab/a", False),
        ("", "s3://lab/a", False),
        ("://", "s3://lab/a", False),
        ("gs://", "s3://lab/a", False),
    ],
)
def test_a_prefix_covers_whole_parts_of_a_url(user, monkeypatch, prefix, url, says):
    assert remote.covers(prefix, url) is says
    monkeypatch.setenv(REMOTE, f"s3://else/ {prefix}")
    if says:
        remote.check_allowed(url)
    else:
        with pytest.raises(FileError, match="are read only if you allow it"):
            remote.check_allowed(url)


def test_the_users_own_configuration_allows_for_the_workers_too(user):
    user('[remote]\nallow = ["s3://our-lab/warm tests", "s3://second/"]\n')
    with pytest.raises(FileError, match="are read only"):
        remote.check_allowed("s3://rig-2/D1.csv")
    assert remote.allowed() == ""
    remote.check_allowed("s3://our-lab/warm tests/D1.csv")
    assert remote.allowed() == "s3://our-lab/warm%20tests s3://second/"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("remote = 1", "[remote] allow is a list of prefixes"),
        ('[remote]\nallow = "s3://rig-2/"', "[remote] allow is a list of prefixes"),
        ("[remote]\nallow = [1]", "[remote] allow is a list of prefixes"),
        ('[remote]\nallow = ["rig-2"]', "[remote] allow is a list of prefixes"),
        ("[remote", "config.toml: not valid TOML"),
        ("x = " + "[" * 5000, "nests more than"),
        ("x" * 200_000, "more than the 100 kB allowed"),
    ],
)
def test_a_configuration_that_cannot_be_read_allows_nothing_and_is_told(user, text, says):
    user(text)
    with pytest.raises(FileError, match="are read only") as caught:
        remote.check_allowed("s3://rig-2/D1.csv")
    assert says in str(caught.value)


def test_a_configuration_that_others_could_write_allows_nothing_and_is_told(user):
    user('[remote]\nallow = ["s3://rig-2/"]')
    userfolders.config_folder().chmod(0o777)
    with pytest.raises(FileError, match="chmod 700 makes it yours alone"):
        remote.check_allowed("s3://rig-2/D1.csv")


@pytest.mark.sampled(2)
def test_a_campaign_folder_allows_nothing(elsewhere, user, asked, monkeypatch):
    """Whatever lies there: a configuration as the user's, settings of AWS, of a shell or of Python."""
    said = '[remote]\nallow = ["s3://"]\n'
    for name in ("config.toml", "fourpole/config.toml", ".config/fourpole/config.toml", "campaign/config.toml"):
        (elsewhere.path / name).parent.mkdir(parents=True, exist_ok=True)
        (elsewhere.path / name).write_text(said)
    (elsewhere.path / ".env").write_text("FOURPOLE_REMOTE=s3://\n")
    monkeypatch.chdir(elsewhere.path)
    assert run("analyse", ".", "--tables-only", "--route", "mobility").exit_code == 3
    assert asked == []


@pytest.mark.sampled(2)
def test_verify_says_that_it_may_not_ask(elsewhere, user, asked):
    run("analyse", elsewhere.path, "--tables-only", "--route", "mobility")
    record = elsewhere.path / "results" / "study.json"
    content = json.loads(record.read_text())
    content["sha256"]["s3://rig-2/warm/D2.csv"] = "0" * 64
    record.write_text(json.dumps(content))
    done = run("verify", elsewhere.path)
    assert asked == []
    assert SAYS in " ".join(done.output.split())

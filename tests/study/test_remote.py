"""Recordings named by URL: file:// inside the campaign folder, s3:// on a server of this machine; nothing else."""

from __future__ import annotations

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor

import pytest
from tests.entries import entries_of
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.errors import FileError
from fourpole.io import child as children
from fourpole.io import remote, userfolders
from fourpole.io.processes import REMOTE
from fourpole.io.remote import address_of, local_path

pytestmark = pytest.mark.thorough

ROW = "recordings/D2.csv"


def test_a_file_url_inside_the_folder_is_the_file(noisy):
    before = noisy.analyse(route="mobility").dynamic
    noisy.edit("tests.csv", ROW, noisy.recording("D2").as_uri())
    found = noisy.analyse(route="mobility").dynamic
    assert found.drop("remarks").equals(before.drop("remarks"))
    assert CliRunner().invoke(app, ["check", str(noisy.path)]).exit_code == 0


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("file:///etc/hostname", "lies outside the campaign folder"),
        ("file://{folder}/recordings/../../outside.csv", "has a step upwards, '..'"),
        ("file://{folder}/recordings/%2e%2e/%2e%2e/outside.csv", "has a step upwards, '..'"),
        ("file://server/share/D2.csv", "names another machine"),
        ("file://recordings/D2.csv", "names another machine"),
        ("ftp://server/D2.csv", "ftp:// is not read"),
        ("https://server/D2.csv", "https:// is not read"),
        ("s3://bucket/../other/D2.csv", "has a step upwards, '..'"),
        ("s3://bucket/%2e%2e/D2.csv", "has a step upwards, '..'"),
        ("s3://bucket", "names no object"),
        ("simplecache::s3://bucket/D2.csv", "there is no such file"),
    ],
)
@pytest.mark.sampled(6)
def test_a_url_that_leads_elsewhere_is_one_rejected_row(noisy, url, says):
    (noisy.path.parent / "outside.csv").write_bytes(noisy.recording("D2").read_bytes())
    noisy.edit("tests.csv", ROW, url.format(folder=noisy.path))
    found = noisy.analyse(route="mobility").dynamic
    assert found["verdict"].to_list() == ["ok", "rejected", "ok", "ok"]
    assert says in found["remarks"][1]


@pytest.fixture(scope="module")
def server():
    """The address of an S3 server of this machine."""
    moto = pytest.importorskip("moto.server")
    pytest.importorskip("s3fs")
    made = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    made.start()
    host, port = made.get_host_and_port()
    yield f"http://{host}:{port}"
    made.stop()


@pytest.fixture(scope="module")
def client(server):
    """A client of the server; credentials and address are in the environment, also in that of one worker for all."""
    boto3 = pytest.importorskip("boto3")
    stated = {"ENDPOINT_URL": server, "ACCESS_KEY_ID": "a", "SECRET_ACCESS_KEY": "b", "DEFAULT_REGION": "us-east-1"}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in stated.items():
            patch.setenv(f"AWS_{name}", value)
        children.child().close(for_good=False)
        made = boto3.client("s3")
        made.create_bucket(Bucket="rig")
        yield made
        made.close()
        children.child().close(for_good=False)


@pytest.fixture
def bucket(client, monkeypatch):
    """The client, with an empty bucket, which the environment allows to read."""
    monkeypatch.setenv(REMOTE, "s3://")
    yield client
    for one in client.list_objects_v2(Bucket="rig").get("Contents", []):
        client.delete_object(Bucket="rig", Key=one["Key"])


@pytest.mark.sampled(8)
def test_recordings_of_a_server_give_the_same_tables(noisy, bucket):
    before = noisy.analyse(route="mobility")
    for name in ("D2", "S1"):
        bucket.upload_file(str(noisy.recording(name)), "rig", f"2026/warm tests/{name}.csv")
        noisy.edit("tests.csv", f"recordings/{name}.csv", f"s3://rig/2026/warm tests/{name}.csv")
        noisy.recording(name).unlink()
    kept = noisy.path / "kept"
    found = noisy.analyse(route="mobility", cache=kept)
    assert found.dynamic.equals(before.dynamic)
    assert found.static.equals(before.static)
    assert found.sha256["s3://rig/2026/warm tests/D2.csv"] == before.sha256[ROW]
    entries = entries_of(kept)
    assert noisy.analyse(route="mobility", cache=kept).dynamic.equals(before.dynamic)
    assert entries_of(kept) == entries


@pytest.mark.sampled(4)
def test_a_changed_object_is_read_again(noisy, bucket):
    bucket.upload_file(str(noisy.recording("D2")), "rig", "D2.csv")
    noisy.edit("tests.csv", ROW, "s3://rig/D2.csv")
    first = noisy.analyse(route="mobility", cache=noisy.path / "kept").dynamic
    noisy.cells("D2", slice(0, 1), 3, "0.0001")
    bucket.upload_file(str(noisy.recording("D2")), "rig", "D2.csv")
    second = noisy.analyse(route="mobility", cache=noisy.path / "kept").dynamic
    assert [a != b for a, b in zip(first.rows(), second.rows(), strict=True)] == [False, True, False, False]


@pytest.mark.parametrize(
    ("url", "says"),
    [("s3://rig/none.csv", "there is no such object"), ("s3://no-such-bucket/D2.csv", "s3://no-such-bucket/D2.csv: ")],
)
def test_an_object_that_is_not_there_is_one_rejected_row(noisy, bucket, url, says):
    noisy.edit("tests.csv", ROW, url)
    found = noisy.analyse(route="mobility").dynamic
    assert found["verdict"].to_list() == ["ok", "rejected", "ok", "ok"]
    assert says in found["remarks"][1]


def test_an_object_that_is_too_large_is_not_fetched(noisy, bucket, monkeypatch):
    from fourpole.io.remote import fetched

    bucket.put_object(Bucket="rig", Key="big.csv", Body=bytes(5000))
    with pytest.raises(FileError, match="more than the"), fetched("s3://rig/big.csv", max_bytes=4000):
        pass


def test_without_the_libraries_the_error_names_what_to_install(monkeypatch):
    from fourpole.io.remote import remote_identity

    monkeypatch.setenv(REMOTE, "s3://rig/")
    monkeypatch.setitem(sys.modules, "s3fs", None)
    with pytest.raises(FileError, match=r"pip install 'fourpole\[remote\]'"):
        remote_identity("s3://rig/D2.csv")


def test_the_group_is_no_part_of_the_address():
    assert address_of("s3://rig/a/D2.mf4#run 1") == "s3://rig/a/D2.mf4"
    assert local_path("file:///a/D2.mf4#run") == "/a/D2.mf4#run"


# --- a permission reaches who reads ----------------------------------------------------------------------------------


@pytest.fixture
def uploaded(noisy, bucket, monkeypatch):
    """A campaign with two recordings on a server, which nothing allows yet; and its tables from local files."""
    before = noisy.analyse(route="mobility")
    for name in ("D2", "S1"):
        bucket.upload_file(str(noisy.recording(name)), "rig", f"2026/{name}.csv")
        noisy.edit("tests.csv", f"recordings/{name}.csv", f"s3://rig/2026/{name}.csv")
    monkeypatch.setenv(REMOTE, "")
    assert noisy.analyse(route="mobility").counts["rejected"] == 2  # by a worker that lives on, without permission
    return noisy, before


@pytest.mark.sampled(6)
def test_the_argument_allows_it_for_the_call_alone(uploaded):
    noisy, before = uploaded
    assert noisy.analyse(route="mobility", remote=True).dynamic.equals(before.dynamic)
    assert remote.allowed() == ""
    assert noisy.analyse(route="mobility").counts["rejected"] == 2


@pytest.mark.sampled(8)
def test_the_users_configuration_reaches_worker_processes(uploaded, tmp_path, monkeypatch):
    noisy, before = uploaded
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    (userfolders.config_folder() / "config.toml").write_text('[remote]\nallow = ["s3://rig/2026"]\n')
    remote._configured.cache_clear()
    try:
        assert noisy.analyse(route="mobility", workers=2).dynamic.equals(before.dynamic)
    finally:
        remote._configured.cache_clear()
        userfolders.user_key.cache_clear()


def without_permission():
    os.environ.pop(REMOTE, None)


@pytest.mark.sampled(8)
def test_a_job_takes_the_permission_of_its_sender_along(uploaded):
    """As to a worker of a cluster, which was started by somebody else."""
    noisy, before = uploaded
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=without_permission) as pool:
        assert noisy.analyse(route="mobility", executor=pool, remote=True).dynamic.equals(before.dynamic)
        assert noisy.analyse(route="mobility", executor=pool).counts["rejected"] == 2

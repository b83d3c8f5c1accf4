"""A real Dask scheduler with workers of one thread on this machine: same tables, whatever becomes of a worker."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from tests.processes import environment
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.errors import CampaignError
from fourpole.study.cluster import cluster

pytestmark = pytest.mark.thorough


def started(module, *words):
    one_thread = environment(OPENBLAS_NUM_THREADS="1", POLARS_MAX_THREADS="1")
    return subprocess.Popen([sys.executable, "-m", module, *words], stderr=subprocess.PIPE, text=True, env=one_thread)


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """The address of a scheduler, and its two workers."""
    pytest.importorskip("distributed")
    scheduler = started("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    address = ""
    for line in scheduler.stderr:
        if found := re.search(r"Scheduler at:\s+(tcp://\S+)", line):
            address = found[1]
            break
    place = str(tmp_path_factory.mktemp("dask"))
    words = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", place)
    workers = [started("distributed.cli.dask_worker", *words) for _ in range(2)]
    from distributed import Client

    client = Client(address, timeout=60, set_as_default=False)
    client.wait_for_workers(2, timeout=120)
    client.close()
    yield address, workers
    for one in (*workers, scheduler):
        one.kill()
        one.communicate()


@pytest.mark.sampled(4)
def test_the_tables_are_those_of_this_machine_though_a_worker_dies_half_way(noisy, dask, monkeypatch):
    address, workers = dask
    monkeypatch.setattr("fourpole.study.workers._TASK", 0.0)
    killed = []

    def kill(done, total):
        if not killed:
            workers[0].kill()
            killed.append(done)

    with cluster(address) as executor:
        found = noisy.analyse(route="mobility", executor=executor, progress=kill)
    assert killed == [1]
    here = noisy.analyse(route="mobility")
    assert found.dynamic.equals(here.dynamic)
    assert found.previews.equals(here.previews)
    assert found.sha256 == here.sha256


@pytest.mark.sampled(3)
def test_the_command_takes_the_address_of_a_scheduler(noisy, dask):
    words = ["analyse", str(noisy.path), "--tables-only", "--route", "mobility"]
    ran = CliRunner().invoke(app, [*words, "--scheduler", dask[0]])
    assert ran.exit_code == 0, ran.output
    there = (noisy.path / "results" / "dynamic.csv").read_bytes()
    assert CliRunner().invoke(app, [*words, "--out", str(noisy.path / "here")]).exit_code == 0
    assert (noisy.path / "here" / "dynamic.csv").read_bytes() == there
    ran = CliRunner().invoke(app, [*words, "--scheduler", dask[0], "--workers", "2", "--monte-carlo", "0"])
    assert ran.exit_code == 2
    assert "contradict each other" in ran.stderr


def test_a_scheduler_that_does_not_answer_is_one_error(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("fourpole.study.cluster._ANSWER", 0.5)
    for address in ("tcp://127.0.0.1:1", "no address", "tcp://"):
        with pytest.raises(CampaignError, match="no Dask scheduler answers there"), cluster(address):
            pass


def test_without_dask_the_error_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(CampaignError, match=r"pip install 'fourpole\[cluster\]'"), cluster("tcp://127.0.0.1:1"):
        pass

"""Where recordings are demodulated: in this thread, in worker processes of this machine, or on a cluster.

One interface serves all: `concurrent.futures.Executor`. The tasks are batches of jobs, `run_batch`. Whatever thread or
process runs a batch, a file that a library reads is read by a worker process of its own (`fourpole.io.child`), with
limits of memory and time. A recording whose worker dies is run once more, by itself, when all others are done.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from itertools import compress, groupby, islice
from typing import TypeAlias

from fourpole.campaign.place import at_hand, identity_or_none, is_guarded
from fourpole.campaign.row import Test
from fourpole.core.checks import CHECK_CLASSES, Check, Code, Verdict, fault_of, reported
from fourpole.errors import CampaignError, FourpoleError, Message
from fourpole.io.child import SECONDS, Child, Died, Late, Piece, answer_of, child
from fourpole.io.door import sha256_of
from fourpole.io.identity import Identity
from fourpole.io.packed import pack, unpack
from fourpole.io.remote import allow, is_elsewhere
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.study.cache import Cache, packed, unpacked
from fourpole.study.points import Demodulated, Points
from fourpole.study.reduce import OF_WORK as OF_JOB
from fourpole.study.reduce import Reduction, check_part, demodulated, points_of

#: Largest number of worker processes that is chosen by itself.
_MOST = 8
#: Time of one recording [s], and its additional time per byte [s/byte]: 25 ms for 1.3 MB of CSV.
_SECONDS, _PER_BYTE = 5e-3, 1.5e-8
#: Worker processes are started for more work than this [s]: each takes 0.6 s to start.
_PAYS = 3.0
#: Work of one task for an executor that takes its time for each [s], and most work of one for a worker process: whoever
#: wakes this process takes time from the workers. Each has this number of tasks or more, so that all end together.
_TASK, _MOST_OF_TASK, _TASKS = 0.3, 0.2, 20
#: Number of tasks in flight per worker, so that none waits, and the memory is bounded.
_AHEAD = 3
#: Most parts of one recording in a task: so many are lost if its worker dies.
_MOST_PARTS = 64
#: Number of files about which servers are asked at a time.
_ASKED = 16
#: Interval at which Ctrl-C is looked for where a wait cannot be interrupted [s].
_LOOK = 0.5

#: The packed bytes of what a recording gave, or the reason why its worker died.
Answer: TypeAlias = "bytes | str"
#: The classes of which a job is made, for the worker process.
OF_WORK = OF_JOB


def run_batch(jobs: Sequence[Reduction], sizes: Sequence[int], seconds: float, guarded: bool) -> list[Answer]:
    """Demodulate recordings one after the other: the task of any executor.

    Parameters
    ----------
    jobs : sequence of Reduction
        The jobs, those of one file side by side: it is read once.
    sizes : sequence of int [byte]
        Size of the file of each; 0 if it is unknown.
    seconds : float [s]
        Limit of the processor time of each; a large file has more.
    guarded : bool
        Whether they are run in the worker process of this thread; otherwise only if there is a reason.
    """
    if any(is_elsewhere(job.test.file) for job in jobs):
        allow(jobs[0].remote)  # a worker of a cluster has the permission of the user who sends the jobs
    pairs = groupby(zip(jobs, sizes, strict=True), key=lambda pair: pair[0].test.file)
    files = [_File([job for job, _ in group], group[0][1]) for group in (list(one) for _, one in pairs)]
    apart = [guarded or is_guarded(one.jobs[0].folder, one.jobs[0].test.file) for one in files]
    pieces = [one.piece(seconds) for one in compress(files, apart)]
    told = iter(child().calls(demodulate_packed, pieces) if pieces else ())
    of_files = [
        one.told(next(told), len(pieces)) if other else one.here() for one, other in zip(files, apart, strict=True)
    ]
    return [answer for answers in of_files for answer in answers]


@dataclass(frozen=True)
class _File:
    """The jobs of one file, and its size [byte]."""

    jobs: list[Reduction]
    size: int

    def here(self) -> list[Answer]:
        """The answers, by this process."""
        return [*map(packed, demodulated(self.jobs))]

    def piece(self, seconds: float) -> Piece:
        """The work for a worker process, with a limit of the processor time of each job [s]."""
        common, tests = _common(_Common(self.jobs[0])), [job.test for job in self.jobs]
        return Piece((common, tests), self.size, seconds * len(tests))

    def told(self, answer: bytes | Exception, pieces: int) -> list[Answer]:
        """The answers, from that of a worker process which was asked for so many pieces of work at once."""
        file = self.jobs[0].test.file
        if isinstance(answer, bytes):
            answers: list[Answer] = unpack(answer)
            return answers
        if isinstance(answer, Late) and pieces == 1:  # of several, another one may be too slow
            check = reported(Code.SLOW, Verdict.REJECTED, file=file, error=answer.message)
        elif isinstance(answer, Died):
            return [str(answer)] * len(self.jobs)
        elif isinstance(answer, MemoryError):
            check = fault_of(answer, file)
        else:
            check = reported(Code.FAULT, Verdict.REJECTED, error=Message("fault", "", str(answer)))
        return [packed(Demodulated(checks=(check,), lasting=False))] * len(self.jobs)


def demodulate_packed(common: bytes, tests: list[Test]) -> bytes:
    """The packed results of tests of one file, by the packed job without a test: the work of a worker process."""
    return pack([packed(done) for done in demodulated([replace(_job(common), test=test) for test in tests])])


class _Common:
    """What the jobs of a rig have in common: two are equal if they hold the same objects."""

    def __init__(self, job: Reduction) -> None:
        self.job = job
        self._key = tuple(id(getattr(job, one.name)) for one in fields(job) if one.name != "test")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Common) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=16)
def _common(common: _Common) -> bytes:
    return pack(replace(common.job, test=Test("", 0)))


@lru_cache(maxsize=16)
def _job(common: bytes) -> Reduction:
    job: Reduction = unpack(common, OF_JOB)
    return job


def check_part_of(job: Reduction, *, guarded: bool = False) -> tuple[Check, ...]:
    """The checks of the first part of a recording; see `check_part`.

    It is read in the worker process of this thread if there is a reason, or if `guarded`.
    """
    if not guarded and not is_guarded(job.folder, job.test.file):
        return check_part(job)
    identity = identity_or_none(job.folder, job.test.file)
    size = 0 if identity is None else identity.size
    try:
        checks: tuple[Check, ...] = unpack(answer_of(check_part, job, size=size), CHECK_CLASSES)
    except Died as death:
        code = Code.SLOW if isinstance(death, Late) else Code.READER
        return (reported(code, Verdict.REJECTED, file=job.test.file, error=death.message),)
    return checks


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def pool_of(workers: int | None, count: int, seconds: float) -> AbstractContextManager[Workers | None]:
    """Worker processes for tasks of this number and this time together [s]; None if this thread is enough.

    `workers` is their number; without it they are as many as pay.
    """
    if workers is None:
        workers = min(processors(), _MOST, count) if seconds > _PAYS else 1
    return Workers(workers) if workers > 1 and count else nullcontext()


class Workers(ThreadPoolExecutor):
    """An executor with worker processes: each of its threads has one, and waits for it.

    Parameters
    ----------
    count : int
        Number of worker processes.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._children: list[Child] = []
        super().__init__(count, thread_name_prefix="fourpole", initializer=lambda: self._children.append(child()))

    def stop(self) -> None:
        """End all workers at once, in the middle of their work."""
        self.shutdown(wait=False, cancel_futures=True)
        for process in self._children:
            process.close()

    def __exit__(self, *error: object) -> None:
        if error[0] is not None:
            self.stop()
        self.shutdown(wait=True)
        for process in self._children:
            process.close()


def reduce_tests(
    jobs: Sequence[Reduction],
    *,
    cache: Cache | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    seconds: float = SECONDS,
    progress: Callable[[int, int], None] | None = None,
    arrived: Callable[[str, Points], None] | None = None,
) -> Points:
    """The points of the jobs in the order of the jobs, from the cache where it has them.

    Parameters
    ----------
    jobs : sequence of Reduction
    cache : Cache, optional
    workers : int, optional
        Number of worker processes; 1 for this thread; by default as many as pay.
    executor : Executor, optional
        An executor to use in place of worker processes.
    seconds : float [s]
        Limit of the processor time of a recording; a large file has more.
    progress, arrived : callable, optional
        As for `analyse`.
    """
    with ThreadPoolExecutor(_ASKED) as asking:  # servers are asked about several files at a time
        each = asking.map if any(is_elsewhere(job.test.file) for job in jobs) else map
        identities = list(each(lambda job: identity_or_none(job.folder, job.test.file), jobs))
    sizes = {job.test.file: each.size for job, each in zip(jobs, identities, strict=True) if each is not None}
    costs = [_SECONDS + _PER_BYTE * sizes.pop(job.test.file, 0) for job in jobs]  # a file is read once
    run = _Run(jobs, cache, seconds, progress, arrived, identities, costs)
    left = [index for index in range(len(jobs)) if not run.recall(index)]
    cost = sum(costs[index] for index in left)
    pool = pool_of(workers, len(left), cost) if executor is None else nullcontext(executor)
    try:
        with pool as used:
            if used is None:
                dead = []
                for batch in run.batches(left, 0.0):
                    dead += run.taken(batch, run_batch(*run.work(batch), guarded=False))
            else:
                dead = run.by(used, left)
            for index in dead:
                run.once_more(index)
    finally:
        if cache is not None:
            cache.close()
    return Points.joined([run.results[index] for index in range(len(jobs))])


@dataclass
class _Run:
    """The jobs of one analysis, with the identities of their files, estimates of their times [s], and results."""

    jobs: Sequence[Reduction]
    cache: Cache | None
    seconds: float
    progress: Callable[[int, int], None] | None
    arrived: Callable[[str, Points], None] | None
    identities: Sequence[Identity | None]
    costs: Sequence[float]
    results: dict[int, Points] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)

    def recall(self, index: int) -> bool:
        """Take the result of a job that the cache has, or whose test cannot be used; False for another one."""
        job, cache, identity = self.jobs[index], self.cache, self.identities[index]
        if job.test.problem:
            return self.take(index, demodulated([job])[0])
        if cache is None or identity is None:
            return False
        sha256 = cache.hash_noted(job.test.file, identity) or self.hashes.get(job.test.file, "")
        if not sha256 and cache.may_have(job.test.file):
            with suppress(FourpoleError, OSError), at_hand(job.folder, job.test.file) as path:
                sha256 = self.hashes[job.test.file] = sha256_of(path, max_bytes=MAX_FILE_BYTES)
            cache.note(job.test.file, identity, sha256)
        done = cache.recall(cache.name(job.settings, sha256)) if sha256 else None
        return done is not None and self.take(index, done)

    def take(self, index: int, done: Demodulated) -> bool:
        """Take what the recording of a job gave."""
        self.results[index] = points_of(self.jobs[index], done)
        if self.arrived is not None:
            self.arrived(self.jobs[index].test.name, self.results[index])
        if self.progress is not None:
            self.progress(len(self.results), len(self.jobs))
        return True

    def work(self, indices: Sequence[int]) -> tuple[list[Reduction], list[int], float]:
        """The work of some jobs for `run_batch`."""
        sizes = [0 if one is None else one.size for one in (self.identities[index] for index in indices)]
        return [self.jobs[index] for index in indices], sizes, self.seconds

    def by(self, executor: Executor, left: Sequence[int]) -> list[int]:
        """Run jobs by an executor, a few tasks in flight; returns the indices of those whose worker died."""
        own, count = isinstance(executor, Workers), getattr(executor, "count", _MOST)
        elsewhere = not own and _is_elsewhere(executor)
        dead: list[int] = []
        running: dict[Future[list[Answer]], list[int]] = {}
        cost = sum(self.costs[index] for index in left)
        batches = self.batches(left, min(_MOST_OF_TASK, cost / (_TASKS * count)) if own else _TASK)
        waiting = next(batches, None)
        try:
            while running or waiting:
                while waiting and len(running) < _AHEAD * count:
                    running[executor.submit(run_batch, *self.work(waiting), own or elsewhere)] = waiting
                    waiting = next(batches, None)
                for future in wait(running, timeout=_LOOK, return_when=FIRST_COMPLETED).done:
                    indices = running.pop(future)
                    dead += self.taken(indices, _answers(future, len(indices)))
        finally:
            for future in running:
                future.cancel()
        return dead

    def batches(self, left: Sequence[int], seconds: float) -> Iterator[list[int]]:
        """Jobs in batches of about this time [s] and of whole files, which are read once, but for the longest ones."""
        batch: list[int] = []
        for _, group in groupby(left, key=lambda index: self.jobs[index].test.file):
            while part := list(islice(group, _MOST_PARTS)):
                batch += part
                if sum(self.costs[index] for index in batch) >= seconds:
                    yield batch
                    batch = []
        if batch:
            yield batch

    def taken(self, indices: Sequence[int], answers: Sequence[Answer]) -> list[int]:
        """Take the answers to some jobs, and keep them in the cache; those whose worker died."""
        dead = []
        for index, answer in zip(indices, answers, strict=True):
            if isinstance(answer, str):
                dead.append(index)
                continue
            job, done = self.jobs[index], unpacked(answer)
            if self.cache is not None and done.sha256:
                self.cache.note(job.test.file, self.identities[index], done.sha256)
                if done.lasting:
                    self.cache.keep(self.cache.name(job.settings, done.sha256), answer)
            self.take(index, done)
        return dead

    def once_more(self, index: int) -> None:
        """Run a job again by itself, in a worker of its own; if it dies again, its test is rejected."""
        (answer,) = run_batch(*self.work([index]), guarded=True)
        if isinstance(answer, str):
            why, file = Message("reader", "", answer), self.jobs[index].test.file
            check = reported(Code.READER, Verdict.REJECTED, file=file, error=why)
            self.take(index, Demodulated(checks=(check,), lasting=False))
        else:
            self.taken([index], [answer])


def _is_elsewhere(executor: Executor) -> bool:
    """Whether an executor runs tasks neither in threads nor in processes of this one."""
    from concurrent.futures import ProcessPoolExecutor  # with multiprocessing, which a worker has no use for

    return not isinstance(executor, ThreadPoolExecutor | ProcessPoolExecutor)


def _answers(future: Future[list[Answer]], count: int) -> list[Answer]:
    """The answers of a task; the same reason for all its jobs if the executor lost it.

    CampaignError if the executor cannot run tasks at all.
    """
    try:
        return future.result()
    except CancelledError:
        raise CampaignError(
            "the executor stopped, or its scheduler cannot be reached any more; what is done is kept in the cache: run "
            "the command again"
        ) from None
    except Exception as error:
        if isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker":
            return ["ended the process that read it"] * count
        raise CampaignError(
            f"the executor cannot run the reduction ({type(error).__name__}: {error}): check that the same version of "
            "fourpole is installed where it runs, and that the campaign folder can be read there"
        ) from error

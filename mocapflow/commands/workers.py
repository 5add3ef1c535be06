"""Runs many tasks: in this process, on processes of its own, or on the workers of a dask scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Annotated, Any, TypeVar

import typer

from mocapflow.errors import ComponentFailed, PipelineError

Workers = Annotated[int, typer.Option(min=1, help="Processes on this machine.")]
Scheduler = Annotated[
    str | None, typer.Option(help="tcp://… of a running dask scheduler whose workers see the same files.")
]
Key = TypeVar("Key")
Result = TypeVar("Result")


def finished(
    tasks: Mapping[Key, Callable[[], Result]], workers: int, scheduler: str | None
) -> Iterator[tuple[Key, Callable[[], Result]]]:
    """Run all tasks and yield each, when it is done, with a call that returns its result or raises what it raised.

    In this process it is the call that runs the task. The locks of the store keep the workers out of each other's way.
    dask gives the task of a lost worker to another, where it goes on from the last frame committed; a task that kills
    three workers is given up.

    Raises:
        PipelineError: dask is not installed, or no scheduler answers.
    """
    if scheduler is None and workers == 1:
        yield from tasks.items()
        return
    try:
        from dask import distributed
    except ImportError as error:
        raise PipelineError("several workers need dask", hint="pip install 'mocapflow[cluster]'") from error
    with connected(distributed, workers, scheduler) as client:
        futures = {client.submit(task, pure=False): key for key, task in tasks.items()}
        for future in distributed.as_completed(list(futures)):  # type: ignore[no-untyped-call]
            yield futures[future], partial(result_of, future, distributed.KilledWorker)


def result_of(future: Any, killed: type[Exception]) -> Any:
    """Return the result of a task that dask has run, or raise what it raised."""
    try:
        return future.result()
    except killed as error:
        hint = "workers that run out of memory end so: start fewer at a time"
        raise ComponentFailed(f"every worker that tried it was lost: {error}", hint=hint) from None


def connected(distributed: Any, workers: int, scheduler: str | None) -> Any:
    """Return a client of a running scheduler, or of workers of our own, one thread each."""
    if scheduler is None:
        with lean():
            return distributed.Client(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None)
    try:
        return distributed.Client(scheduler)
    except (OSError, ValueError) as error:
        hint = (
            f"start one with `dask scheduler`, and on every machine `dask worker --nthreads 1 --no-nanny {scheduler}`"
        )
        raise PipelineError(f"no dask scheduler answers at {scheduler}", hint=hint) from error


def lean() -> Any:
    """Return a context in which workers start without what dask adds for its own kind of work.

    Its profiler takes a fifth of a worker's time, and its limit for giving memory back makes every larger array of a
    frame a call to the system, which costs a quarter more.
    """
    from dask import config

    environment = dict(config.get("distributed.nanny.pre-spawn-environ"))
    environment.pop("MALLOC_TRIM_THRESHOLD_", None)
    return config.set({"distributed.nanny.pre-spawn-environ": environment, "distributed.worker.profile.enabled": False})

"""Where batches of trials are run: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

from golem.errors import ConfigError
from golem.evaluation.harness.trials import Batch, Ending


class TrialExecutor(Protocol):
    """Runs batches, in any order; records do not depend on which executor that is.

    A batch that crashes, hangs or loses its machine ends with `Died` or `Overdue`; it never takes others with it.
    """

    def submit(self, batch: Batch) -> None:
        """Add a batch; also while results are read."""
        ...

    def results(self) -> Generator[tuple[Batch, Ending], None, None]:
        """Yield each batch and how it ended, until all that were submitted have.

        Raises:
            golem.errors.GolemError: nothing can run any more.
        """
        ...

    def close(self) -> None:
        """End what is in flight, and every process that was started."""
        ...


def make_executor(where: str, processes: int) -> TrialExecutor:
    """Return the executor that `--executor` names.

    Args:
        where: `local`, or `dask:ADDRESS` with the address of a scheduler.
        processes: of the local one.

    Raises:
        ConfigError: it is neither.
        golem.errors.GolemError: the cluster cannot be reached, or what it needs is not installed.
    """
    kind, _, address = where.partition(":")
    if where == "local":
        from golem.evaluation.harness.local_executor import LocalExecutor

        return LocalExecutor(processes)
    if kind == "dask" and address:
        from golem.evaluation.harness.dask_executor import DaskExecutor

        return DaskExecutor(address)
    raise ConfigError(
        f"--executor is 'local' or 'dask:ADDRESS', e.g. dask:tcp://10.0.0.1:8786; not '{where}'."
    )

"""The errors a user can cause. Each says in one sentence what is wrong and what would be right."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable

from golem.traces import Trace, describe, trace_of


class GolemError(Exception):
    """Root of every error that a user, not a programmer, can cause; the CLI prints it and exits with 2."""


class ConfigError(GolemError):
    """A stack file, an option or an argument does not say something this software can do."""


class OutputError(GolemError):
    """A result cannot be written where the user asked."""


LOCKS = {"foxglove": "record"}
"""The lock in requirements/ that holds an extra, where it is not the one of its name."""


class MissingExtra(GolemError):
    """An optional dependency is absent."""

    def __init__(self, package: str, extra: str) -> None:
        """Name the absent `package` and the `extra` whose installation brings it."""
        super().__init__(
            f"The Python package '{package}' is not installed; install it with: make venv-{LOCKS.get(extra, extra)} in "
            f"a clone, or pip install 'golem-humanoid[{extra}]' where its wheel is installed"
        )


class needs:  # noqa: N801 - it is read as a word
    """Around the import of what an extra brings: `with needs("rosbags", "dds"):` raises MissingExtra without it."""

    def __init__(self, package: str, extra: str) -> None:
        """Name the `package`, or nothing for the module that is absent, and the `extra` that brings it."""
        self._package, self._extra = package, extra

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, ImportError):
            raise MissingExtra(self._package or error.name or str(error), self._extra) from error


class MissingEnvironment(MissingExtra):
    """An environment of its own, in which an optional dependency is installed, is absent."""

    def __init__(self, sentence: str) -> None:
        """Say in one `sentence` what is absent and how to get it."""
        GolemError.__init__(self, sentence)


class MissingSystemLibrary(GolemError):
    """A shared library of the operating system is absent."""


class ServiceUnavailable(GolemError):
    """A service outside this process that a module asks does not answer, or answers nonsense."""


class ModuleFault(GolemError):
    """A module of the stack raised, or returned something its contract forbids.

    Attributes:
        slot: the stack slot of the module, e.g. `"upper_body"`.
        use: the implementation as the stack file names it.
        reason: how, in one line.
        trace: where in its code it raised, as Python prints it, without the frames of others; None where it did not.
    """

    def __init__(self, slot: str, use: str, reason: str, trace: str | None = None) -> None:
        """Describe which module (`slot`, `use`) broke its contract and how (`reason`)."""
        super().__init__(f"Module {slot}: {use} failed: {reason}")
        self.slot = slot
        self.use = use
        self.reason = reason
        self.trace = trace

    @classmethod
    def of(cls, slot: str, use: str, error: BaseException, doing: str = "") -> ModuleFault:
        """Return the fault of the module (`slot`, `use`) that raised `error`, which was just caught.

        Args:
            use: its name in the stack file.
            error: what was raised. A `ConfigError` is about what the user wrote elsewhere, `ServiceUnavailable` about
                another machine; they get no trace.
            doing: what goes before it in the reason, e.g. `"importing it raised "`.
        """
        trace = Trace() if isinstance(error, ConfigError | ServiceUnavailable) else trace_of(error)
        where = f" ({trace.where})" if trace.where else ""
        return cls(slot, use, f"{doing}{describe(error)}{where}", trace.text)


class SlowModule(UserWarning):
    """A module takes far longer than it declares."""


class RobotGone(GolemError):
    """The robot is no longer there, through no fault of its module: the recording that stands in for it is over."""


def shorten(text: str, limit: int = 120) -> str:
    """Return `text`, cut to `limit` characters: an error never repeats megabytes that a stranger sent."""
    return text if len(text) <= limit else f"{text[:limit]}..."


def unknown_name(kind: str, name: str, valid: Iterable[str]) -> ConfigError:
    """Return the error for a name that is not one of `valid`, with the nearest valid name first.

    Args:
        kind: what the name names, e.g. `"rung"`.
        name: what the user wrote.
        valid: every name that would have been accepted.
    """
    names, name = sorted(valid), shorten(name)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return ConfigError(f"Unknown {kind} '{name}'; valid: {', '.join(names) or '(none)'}.{hint}")


def check_known(kind: str, valid: Collection[str], *names: str) -> None:
    """Check that each of `names` is one of `valid`. Raises ConfigError: one is not; see `unknown_name`."""
    for name in names:
        if name not in valid:
            raise unknown_name(kind, name, valid)

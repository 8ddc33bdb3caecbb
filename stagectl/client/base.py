"""What both clients share: requests numbered and encoded, answers understood."""

from __future__ import annotations

import getpass
import os
from typing import Any

from pydantic import ValidationError

from stagectl.errors import Aborted, ConfigError, RunFault, StagectlError, UnusableInput
from stagectl.protocol.message import VERSION
from stagectl.protocol.requests import Command, Request
from stagectl.protocol.state import Answer, Job, Notice, Refusal, State
from stagectl.protocol.wire import NOTICE, SAMPLES, STATE, SampleBlock, encode, unpack

ANSWER = 5.0
"""How long a server may take to answer what takes it no time [s]."""
Published = State | Notice | SampleBlock


class NoServer(StagectlError):  # noqa: N818
    """No server answers."""


class Refused(StagectlError):  # noqa: N818
    """The server refuses a request.

    Attributes:
        refusal: why.
    """

    def __init__(self, refusal: Refusal) -> None:
        super().__init__("\n".join(refusal.problems) or refusal.text)
        self.refusal = refusal


class JobFailed(StagectlError):  # noqa: N818
    """What was asked for has failed.

    Attributes:
        job: with its error.
    """

    def __init__(self, job: Job) -> None:
        super().__init__(job.error or "failed")
        self.job = job

    def as_command_error(self) -> StagectlError:
        """The same failure as a command without a server would raise it."""
        kinds = {"fault": RunFault, "stopped": Aborted, "refused": UnusableInput}
        return kinds.get(self.job.kind or "", StagectlError)(str(self))


def as_command_error(refused: Refused) -> StagectlError:
    """A refusal as a command without a server would raise it."""
    if refused.refusal.kind == "input":
        return ConfigError(refused.refusal.problems or refused.refusal.text)
    return UnusableInput(str(refused))


class Talk:
    """Makes requests and reads answers, for one client.

    Args:
        name: of the client, as others see it; None: program user and process.
    """

    def __init__(self, name: str | None) -> None:
        self.name = name or f"{getpass.getuser()} ({os.getpid()})"
        self.lease: str | None = None
        self._number = 0

    def request(self, command: Command) -> tuple[int, bytes]:
        """The next request's number, and the request."""
        self._number += 1
        made = Request(
            version=1, id=self._number, client=self.name, lease=self.lease, command=command
        )
        return self._number, encode(made)

    def answer(self, data: bytes) -> tuple[int, Any]:
        """Number and result of an answer.

        Raises:
            Refused: the request was.
            NoServer: the server speaks another version.
        """
        try:
            answer = Answer.model_validate(unpack(data))
        except (ValidationError, UnusableInput) as why:
            raise NoServer(f"the server's answer is not understood: {why}") from why
        if answer.version != VERSION:
            raise NoServer(f"the server speaks version {answer.version}, this program {VERSION}")
        if answer.refusal is not None:
            raise Refused(answer.refusal)
        return answer.id, answer.result


def read_published(topic: bytes, data: bytes) -> Published:
    """What a server has published.

    Raises:
        NoServer: it is not understood.
    """
    try:
        if topic == SAMPLES:
            return SampleBlock.decode(data)
        kinds: dict[bytes, type[State] | type[Notice]] = {STATE: State, NOTICE: Notice}
        return kinds[topic].model_validate(unpack(data))
    except (ValidationError, UnusableInput, KeyError) as why:
        raise NoServer(f"the server has published what is not understood: {why}") from why

"""`stagectl monitor`: the frames on the bus, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.file_kinds import FRAME_LOG
from stagectl.cli.files import Output
from stagectl.cli.options import NumberRange, takes
from stagectl.cli.signals import interruptible

if TYPE_CHECKING:
    import can

    from drivers.canopen import Network
    from drivers.commissioning import Decoded, FrameDecoder

_WAIT = 0.1
"""Longest wait for a frame, before Ctrl-C is looked for again [s]."""
_REST = 1.0
"""Longest time to take what waits in a busy bus's queue at the end [s]."""
_REPEAT = 1.0
"""Interval at which a frame is shown that says what its last one said [s]."""
_SIMULATED = 1.0


@click.command
@takes(Bench)
@click.option("--passive", is_flag=True,
              help="Send nothing; PDOs are read by the EDS until a mapping is heard.")  # fmt: skip
@click.option("--all", "every", is_flag=True, help="Show every frame, also those that repeat.")
@click.option("--for", "duration", type=NumberRange(0, 86400), metavar="SECONDS",
              help="End after this time.  [default: at Ctrl-C]")  # fmt: skip
@click.option("--log", type=Output(FRAME_LOG),
              help="Also write all frames to a file: .asc, .blf, .log, .csv or .trc.")  # fmt: skip
def command(
    bench: Bench, passive: bool, every: bool, duration: float | None, log: Path | None
) -> None:
    """Show the frames on the bus by node and object, in SI units, until Ctrl-C.

    \b
      stagectl monitor --bus socketcan:can0
      stagectl monitor --bus socketcan:can0 --all --for 2 --log frames.asc

    Frames that come again and again (SYNC, process data, heartbeats) are shown when a statusword,
    controlword, mode or NMT state in them changes, and once a second, with the number left out.
    The log has all frames.

    At the start mappings and units are read from the machine file's nodes by SDO; with --passive
    they are those of EDS and machine file.
    Can be used while another host runs the stage, unless that host uses SDO at the same moment.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from drivers.commissioning import FrameDecoder

    if bench.simulated and duration is None:
        duration = _SIMULATED
    with ExitStack() as stack:
        record = None if log is None else _logger(log, stack)
        network = stack.enter_context(bench.observer())
        stopped = stack.enter_context(interruptible())
        stopped()  # from here on, Ctrl-C only sets a flag
        decoder = FrameDecoder(bench.axes)
        if not passive:
            for line in decoder.read_nodes(network):
                click.echo(line, err=True)
        screen = _Screen(decoder, every)
        for message in _frames(network, duration, stopped):
            if record is not None:
                record(message)
            screen.show(message, network.clock.now_ns() * 1e-9)
    click.echo(f"{screen.count} frames in {screen.time:.3f} s, {screen.shown} shown", err=True)


def _frames(
    network: Network, duration: float | None, stopped: Callable[[], bool]
) -> Iterator[can.Message]:
    """All frames until `stopped`, or for `duration` [s]; those that wait by then are the last."""
    clock = network.clock
    end = math.inf if duration is None else clock.now_ns() + duration * 1e9
    while (now := clock.now_ns()) < end + _REST * 1e9:
        if now < end and stopped():
            end = now
        message = network.receive(min(max(0.0, (end - now) * 1e-9), _WAIT))
        if message is not None:
            yield message
        elif now >= end:
            return


def _logger(path: Path, stack: ExitStack) -> Callable[[can.Message], None]:
    """Writes frames to a file, in the format of its suffix, until the stack ends."""
    import can

    try:
        writer = can.Logger(path)
    except ValueError:
        raise click.BadParameter(
            f"{path}: unknown format '{path.suffix}'; .asc, .blf, .log, .csv and .trc are known",
            param_hint="--log",
        ) from None
    stack.callback(writer.stop)
    return writer.on_message_received


class _Screen:
    """Prints frames, one line each.

    Attributes:
        count: frames received.  shown: of these.
        time: of the last one since the first [s].
    """

    def __init__(self, decoder: FrameDecoder, every: bool) -> None:
        self._decoder, self._every = decoder, every
        self.count = self.shown = 0
        self.time = 0.0
        self._first: float | None = None
        self._last: dict[int, tuple[tuple[int, ...], float]] = {}
        self._left_out: dict[int, int] = {}

    def show(self, message: can.Message, now: float) -> None:
        """Shows a frame, received at `now` [s] where it has no time stamp of its own."""
        self.count += 1
        stamp = message.timestamp or now
        self._first = stamp if self._first is None else self._first
        self.time = stamp - self._first
        if message.is_error_frame or message.is_remote_frame or message.is_extended_id:
            kind = "error frame" if message.is_error_frame else "remote or extended"
            self._line("", f"0x{message.arbitration_id:X}", f"{kind} {message.data.hex(' ')}")
            return
        can_id = message.arbitration_id
        decoded = self._decoder.decode(can_id, bytes(message.data))
        if self._is_news(can_id, decoded):
            left_out = self._left_out.pop(can_id, 0)
            self._line(decoded.who, decoded.service, decoded.text, left_out)
        else:
            self._left_out[can_id] = self._left_out.get(can_id, 0) + 1

    def _is_news(self, can_id: int, decoded: Decoded) -> bool:
        if self._every or decoded.state is None:
            return True
        state, shown = self._last.get(can_id, (None, 0.0))
        if decoded.state == state and self.time - shown < _REPEAT:
            return False
        self._last[can_id] = decoded.state, self.time
        return True

    def _line(self, who: str, service: str, text: str, left_out: int = 0) -> None:
        self.shown += 1
        more = f"  (+{left_out})" if left_out else ""
        click.echo(f"{self.time:12.6f}  {who:<7} {service:<9}  {text}{more}".rstrip())

"""SocketCAN from user-mode-linux: a Linux kernel as an ordinary process on the host's files.

The kernel process gets three pipes: its own messages, the command's stdout, its stderr; and one
that brings the names of signals in. `init.bash` is its process 1. Whatever ends this program, the
guest ends too: it sees the pipe closed and its folder gone, and a watchman on the host, forked
before anything else, removes the folder and after a while kills what is left.
"""

from __future__ import annotations

import contextlib
import os
import queue
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from vcan_bus.errors import NoBusError
from vcan_bus.host import VARIABLE

MODULES = Path("/usr/lib/uml/modules")
INSTALL = "apt-get install user-mode-linux kmod iproute2"
INSTALL_FOR_AMX = " gcc libc6-dev"
GRACE = 5.0
"""Seconds that a command has after a signal before the guest is switched off."""
LEAVING = 10.0
"""Seconds that a guest has to switch itself off."""


def _kernel() -> str | None:
    return shutil.which("linux.uml", path=os.environ.get("PATH", "") + ":/usr/bin")


def _has_amx() -> bool:
    """Whether the processor's registers are more than this kernel can take (`xstate.c`)."""
    return " amx_tile" in Path("/proc/cpuinfo").read_text()


def require() -> None:
    """Checks that a guest can be booted.

    Raises:
        NoBusError: something is missing, or this is a guest already.
    """
    if "User Mode Linux" in Path("/proc/cpuinfo").read_text():
        raise NoBusError("this is a user-mode-linux guest, and it has no vcan")
    path = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
    missing = [
        tool
        for tool in ("bash", "ip", "insmod", "stty", "setpriv")
        if shutil.which(tool, path=path) is None
    ]
    if _kernel() is None:
        missing.insert(0, "linux.uml")
    if not list(MODULES.glob("*/kernel/drivers/net/can/vcan.ko*")):
        missing.append(f"vcan.ko in {MODULES}")
    if _has_amx() and shutil.which("cc") is None:
        missing.append("C compiler (this processor has AMX)")
    if missing:
        raise NoBusError(
            "no SocketCAN: this kernel has no vcan (or will not let this user have one), and for "
            f"user-mode-linux there is no {', '.join(missing)}. "
            f"On Debian and Ubuntu, as root: {INSTALL}{INSTALL_FOR_AMX * _has_amx()}"
        )


class Stream:
    """Copies a pipe of the guest's to one of ours, always reading, however slow our reader is."""

    def __init__(self, target: int, on_broken: signal.Signals | None, guest: Guest) -> None:
        self._source, self.guest_end = os.pipe()
        self._target = target
        self._on_broken = on_broken
        self._guest = guest
        self._chunks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._threads = [threading.Thread(target=f, daemon=True) for f in (self._read, self._write)]

    def start(self) -> None:
        """To be called once the guest has its end."""
        os.close(self.guest_end)
        for thread in self._threads:
            thread.start()

    def finish(self) -> None:
        """Waits until all has been written."""
        for thread in self._threads:
            thread.join()

    def _read(self) -> None:
        while chunk := os.read(self._source, 65536):
            self._chunks.put(chunk)
        self._chunks.put(b"")

    def _write(self) -> None:
        broken = False
        while chunk := self._chunks.get():
            while chunk and not broken:
                try:
                    chunk = chunk[os.write(self._target, chunk) :]
                except BlockingIOError:
                    time.sleep(0.01)
                except OSError:
                    broken = True
                    if self._on_broken is not None:
                        self._guest.send(self._on_broken)


class KernelLog:
    """The guest's console, of which only the end matters, and only when the guest dies."""

    def __init__(self) -> None:
        self._source, self.guest_end = os.pipe()
        self._text = b""
        self._thread = threading.Thread(target=self._read, daemon=True)

    def start(self) -> None:
        """To be called once the guest has its end."""
        os.close(self.guest_end)
        self._thread.start()

    def _read(self) -> None:
        while chunk := os.read(self._source, 65536):
            self._text = (self._text + chunk)[-4000:]

    def lines(self) -> list[str]:
        """The last ones."""
        self._thread.join(1.0)
        lines = self._text.decode(errors="replace").replace("\r", "").splitlines()
        return [line for line in lines if line.strip()][-15:]


class Guest:
    """One boot of user-mode-linux for one command.

    Attributes:
        ended_by: why the command was ended, as an exit status; None while it was not.
    """

    def __init__(self, folder: Path, arguments: Sequence[str], environment: dict[str, str]) -> None:
        self.ended_by: int | None = None
        self._told = 0.0
        self.log = KernelLog()
        self.streams = [Stream(1, signal.SIGPIPE, self), Stream(2, None, self)]
        listens, self._signals = os.pipe()
        ends = [self.log.guest_end, *(stream.guest_end for stream in self.streams), listens]
        self.process = subprocess.Popen(
            [
                *arguments,
                f"con0=null,fd:{ends[0]}",
                f"con1=null,fd:{ends[1]}",
                f"con2=null,fd:{ends[2]}",
                f"con3=fd:{ends[3]},null",
            ],
            stdin=subprocess.DEVNULL,
            stdout=ends[0],
            stderr=ends[0],
            pass_fds=ends,
            cwd="/",
            env=environment,
            start_new_session=True,  # a terminal's Ctrl-C is for the command, not for the kernel
        )
        os.close(listens)
        self.log.start()
        for stream in self.streams:
            stream.start()

    def send(self, number: signal.Signals) -> None:
        """Sends a signal to the command."""
        with contextlib.suppress(OSError):
            os.write(self._signals, f"{number.name.removeprefix('SIG')}\n".encode())

    def end(self, number: signal.Signals, status: int) -> None:
        """Asks the command to end, the second time no more than once."""
        if self.ended_by is None:
            self.ended_by = status
            self._told = time.monotonic()
            self.send(number)
        else:
            self._told = 0.0

    def wait(self, deadline: float) -> None:
        """Returns when the guest is off, by itself or because its time is over."""
        killed = False
        while self.process.poll() is None:
            now = time.monotonic()
            if self.ended_by is None and now > deadline:
                self.end(signal.SIGTERM, 124)
            if self.ended_by is not None and now > self._told + GRACE:
                if not killed:
                    killed = True
                    self._told = max(self._told, now - GRACE) + 2.0
                    self.send(signal.SIGKILL)
                else:
                    self.kill()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(0.1)
        self.kill()  # processes of the guest's that its kernel left behind

    def kill(self) -> None:
        """Ends the kernel and everything that it started."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)


def _memory_folder() -> str:
    """Where the guest's memory, a deleted file, has room; a container's /dev/shm often has not."""
    for folder in ("/dev/shm", "/tmp", "/var/tmp"):  # noqa: S108
        try:
            facts = os.statvfs(folder)
        except OSError:
            continue
        room = facts.f_bavail * facts.f_frsize
        if room > 1.5e9 and not facts.f_flag & os.ST_NOEXEC and os.access(folder, os.W_OK):
            return folder
    return tempfile.gettempdir()


def _visible(folder: str) -> bool:
    """Whether the guest sees this folder; it has a /dev, /proc and /sys of its own."""
    return not any(Path(folder).resolve().is_relative_to(own) for own in ("/dev", "/proc", "/sys"))


def _folder() -> Path:
    for parent in (tempfile.gettempdir(), "/tmp", "/var/tmp"):  # noqa: S108
        if _visible(parent) and os.access(parent, os.W_OK):
            return Path(tempfile.mkdtemp(prefix="with-vcan-", dir=Path(parent).resolve()))
    raise NoBusError("no folder for temporary files that the guest could see")


def _environment(folder: Path) -> dict[str, str]:
    """The kernel process's own.

    Raises:
        NoBusError: what it needs cannot be compiled.
    """
    own = {"PATH": os.environ.get("PATH", ""), "TMPDIR": _memory_folder(), "HOME": str(folder)}
    if _has_amx():
        source, library = Path(__file__).with_name("xstate.c"), folder / "xstate.so"
        done = subprocess.run(
            ["cc", "-O2", "-shared", "-fPIC", "-o", library, source, "-ldl"],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise NoBusError(f"cannot compile {source}: {' '.join(done.stderr.split())}")
        own["LD_PRELOAD"] = str(library)
    return own


def _script(command: Sequence[str], directory: str) -> bytes:
    """Becomes the command: the caller's environment, folder and rights."""
    own = {
        VARIABLE.encode(): b"vcan0",
        # the guest's memory: sockets work there, and it is gone with the guest
        b"TMPDIR": b"/dev/shm/tmp",
    }
    lines = [b"setpriv=$(PATH=$PATH:/usr/bin:/bin command -v setpriv)\n"]
    for name, value in (dict(os.environb) | own).items():
        if name.decode(errors="replace").isidentifier() and name.isascii():
            lines.append(b"export " + name + b"=" + _quoted(value) + b"\n")
    lines.append(b"cd " + _quoted(os.fsencode(directory)) + b" || exit 125\n")
    arguments = b" ".join(_quoted(os.fsencode(argument)) for argument in command)
    if os.geteuid() == 0:
        lines.append(b"exec env -- " + arguments + b"\n")
    else:
        groups = ",".join(map(str, os.getgroups()))
        drop = f"--reuid={os.geteuid()} --regid={os.getegid()} "
        drop += f"--groups={groups}" if groups else "--clear-groups"
        drop += " --inh-caps=-all"
        lines.append(f'exec "$setpriv" {drop} -- '.encode() + arguments + b"\n")
    return b"".join(lines)


def _quoted(text: bytes) -> bytes:
    return b"'" + text.replace(b"'", b"'\"'\"'") + b"'"


def _settings(time_limit: float | None) -> str:
    settings = {
        "python": sys.executable,
        "limit": "" if time_limit is None else str(int(time_limit + 60)),
        "through_pipes": "" if os.isatty(1) and os.isatty(2) else "yes",
        "one_stream": "yes" if os.path.sameopenfile(1, 2) else "",
        "host": socket.gethostname(),
        "size": _window(),
    }
    return "".join(f"{name}={shlex.quote(value)}\n" for name, value in settings.items())


def _window() -> str:
    """Size of the terminal, as arguments of stty."""
    try:
        size = os.get_terminal_size(1)
    except OSError:
        return ""
    return f"rows {size.lines} cols {size.columns}"


def _watchman(folder: Path) -> int:
    """Forks a process that cleans up should this one die.

    Returns:
        Where to write the guest's process id, and "done" at the end.
    """
    hears, tells = os.pipe()
    if os.fork():
        os.close(hears)
        return tells
    os.close(tells)
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    answer = b""
    while chunk := os.read(hears, 100):
        answer += chunk
    if not answer.endswith(b"done"):
        shutil.rmtree(folder, ignore_errors=True)
        deadline = time.monotonic() + LEAVING
        guest = int(answer or 0)
        while _is_guest(guest, folder) and time.monotonic() < deadline:
            time.sleep(0.2)
        if _is_guest(guest, folder):
            os.killpg(guest, signal.SIGKILL)
        shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _is_guest(process: int, folder: Path) -> bool:
    """Whether this process is still that guest's kernel, and not another of the same number."""
    try:
        return os.fsencode(folder) in Path(f"/proc/{process}/cmdline").read_bytes()
    except OSError:
        return False


def run(command: Sequence[str], time_limit: float | None, memory: int) -> int:
    """Boots, runs, passes output on.

    Args:
        command: program and arguments.
        time_limit: [s] for boot and command; None for none.
        memory: of the guest [MB].

    Returns:
        The command's exit status, or 124, 125, 130 (129, 143) as in the help text.

    Raises:
        NoBusError: there was no exit status.
    """
    directory = os.getcwd()  # noqa: PTH109
    if not _visible(directory):
        raise NoBusError(f"the guest does not see the working directory {directory}")
    deadline = time.monotonic() + (float("inf") if time_limit is None else time_limit)
    folder = _folder()
    watchman = _watchman(folder)
    try:
        shutil.copy(Path(__file__).with_name("init.bash"), folder / "init")
        (folder / "init").chmod(0o700)
        (folder / "settings").write_text(_settings(time_limit))
        (folder / "command").write_bytes(_script(command, directory))
        guest = Guest(
            folder,
            [
                str(_kernel()), "rootfstype=hostfs", "rootflags=/", "rw", f"mem={memory}M",
                f"init={folder}/init", f"uml_dir={folder}/", "umid=guest", "con=null", "quiet",
            ],
            _environment(folder),
        )  # fmt: skip
        os.write(watchman, str(guest.process.pid).encode())

        def on_signal(number: int, frame: FrameType | None) -> None:
            guest.end(signal.Signals(number), 128 + number)

        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup does
                signal.signal(number, on_signal)
        guest.wait(deadline)
        for stream in guest.streams:
            stream.finish()
        if guest.ended_by is not None:
            return guest.ended_by
        return _status(folder, guest)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.write(watchman, b"done")


def _status(folder: Path, guest: Guest) -> int:
    with contextlib.suppress(OSError, ValueError):
        return int((folder / "status").read_text())
    with contextlib.suppress(OSError):
        raise NoBusError((folder / "problem").read_text().strip())
    sys.stderr.writelines(f"  {line}\n" for line in guest.log.lines())
    raise NoBusError("the guest died; the end of its kernel's messages is above")

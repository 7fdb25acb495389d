"""A process at a part of its speed: by a cgroup where one may be made, else by stopping it most of the time."""

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

PERIOD = 0.02
"""Seconds from one stop of the process to the next."""

GROUPS = Path("/sys/fs/cgroup")


class Slowed:
    """Gives a process this part of one core's time while it is entered."""

    def __init__(self, pid, part):
        self.pid, self.part, self.group, self.stop = pid, part, None, threading.Event()
        self.thread = None

    def __enter__(self):
        period = round(1e6 * PERIOD)
        quota = round(period * self.part)
        limits = [
            (GROUPS, {"cpu.max": f"{quota} {period}"}),
            (GROUPS / "cpu", {"cpu.cfs_period_us": str(period), "cpu.cfs_quota_us": str(quota)}),
        ]
        for parent, values in limits:
            if self.limit(parent, values):
                self.how = "cgroup"
                return self
        self.how = "stopped and continued"
        self.thread = threading.Thread(target=self.stop_and_go, daemon=True)
        self.thread.start()
        return self

    def limit(self, parent, values):
        group = parent / f"halflight{os.getpid()}"
        try:
            group.mkdir()
        except OSError:
            return False
        # Where no cgroups are mounted this is a folder like any other.
        if not all((group / name).exists() for name in [*values, "cgroup.procs"]):
            group.rmdir()
            return False
        try:
            for name, value in values.items():
                (group / name).write_text(value)
            (group / "cgroup.procs").write_text(str(self.pid))
        except OSError:
            group.rmdir()
            return False
        self.group = group
        return True

    def stop_and_go(self):
        while not self.stop.is_set():
            os.kill(self.pid, signal.SIGCONT)
            time.sleep(PERIOD * self.part)
            os.kill(self.pid, signal.SIGSTOP)
            time.sleep(PERIOD * (1 - self.part))

    def __exit__(self, *_):
        if self.thread:
            self.stop.set()
            self.thread.join()
            os.kill(self.pid, signal.SIGCONT)
        if self.group:
            with contextlib.suppress(OSError):
                (self.group.parent / "cgroup.procs").write_text(str(self.pid))
            self.group.rmdir()

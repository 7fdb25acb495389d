"""One run of the program in a folder of its own, watched without waiting for it. Needs no Blender."""

import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from . import progress

# Seconds that a program that was told to end has for it.
GRACE = 5.0
LIVE = set()


class BakeError(Exception):
    """A bake that cannot begin or has failed; the text tells the user what to do."""


def find_program(given):
    """Returns the path of the program, from a path or a name to find on PATH.

    Raises BakeError where it is not there.
    """
    found = shutil.which(given or "coordinator")
    if found is None:
        raise BakeError(f"program `{given or 'coordinator'}` not found: install Halflight, or set its path in the add-on's preferences")
    return found


class Runner:
    """The program, its folder, and what it has written so far. [close] removes the folder with everything in it."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="halflight-"))
        self.process = None
        self.progress = None
        self._cancel_job, self._cancelling, self._read, self._killed_at = None, None, 0, None
        LIVE.add(self)

    def start(self, command, cancel_job=None):
        """Starts the program. `cancel_job` returns the command that cancels a job of a service, given the job's id."""
        self._cancel_job = cancel_job
        with open(self.folder / "stdout", "wb") as out, open(self.folder / "stderr", "wb") as err:
            try:
                self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err)
            except OSError as problem:
                raise BakeError(f"program {command[0]} cannot be started: {problem.strerror}") from problem

    def poll(self):
        """Reads what is new; returns whether the program, and the cancelling of its job, have ended. Never waits."""
        if self.process is not None:
            self._look()
        if self._killed_at and time.monotonic() > self._killed_at:
            self._kill()
        return all(one is None or one.poll() is not None for one in (self.process, self._cancelling))

    def _look(self):
        with open(self.folder / "stderr", "rb") as err:
            err.seek(self._read)
            # A line that is not whole yet is read the next time.
            whole = err.read().rpartition(b"\n")[0]
        self._read += len(whole) + 1 if whole else 0
        for line in whole.decode(errors="replace").splitlines():
            self.progress = progress.parse(line) or self.progress

    def wait(self, seconds=None):
        """Polls until everything has ended, for so many seconds at most; returns whether it has."""
        ends = None if seconds is None else time.monotonic() + seconds
        while not self.poll():
            if ends and time.monotonic() > ends:
                return False
            time.sleep(0.05)
        return True

    def check(self):
        """Raises BakeError, with what the program says, unless it ended well."""
        if self.process.returncode:
            told = progress.error(self._text("stderr")) or f"it ended with status {self.process.returncode}"
            raise BakeError(f"the bake failed: {told}")

    def warnings(self):
        """Returns what the program warned of."""
        return progress.warnings(self._text("stderr"))

    def cancel(self):
        """Tells the program to end (SIGTERM), and a service to cancel its job. [poll] tells when they have."""
        if self.process is None or self._killed_at:
            return
        self._killed_at = time.monotonic() + GRACE
        if self.process.poll() is None:
            self.process.terminate()
        job = self._text("stdout").split()
        if self._cancel_job and job:
            quiet = subprocess.DEVNULL
            self._cancelling = subprocess.Popen(self._cancel_job(job[0]), stdin=quiet, stdout=quiet, stderr=quiet)

    def close(self):
        """Ends what still runs, and removes the folder. A second time does nothing."""
        if self not in LIVE:
            return
        self.cancel()
        if not self.wait(GRACE):
            self._kill()
        shutil.rmtree(self.folder, ignore_errors=True)
        LIVE.discard(self)

    def _kill(self):
        for one in (self.process, self._cancelling):
            if one is not None and one.poll() is None:
                one.kill()
                one.wait()

    def _text(self, name):
        file = self.folder / name
        return file.read_text(errors="replace") if file.exists() else ""


def close_all():
    """Ends all runs: the add-on goes away."""
    for runner in list(LIVE):
        runner.close()

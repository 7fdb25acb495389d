"""Building and running the programs that are measured, and the machine they run on."""

import contextlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def build(package, name, arguments=()):
    """Builds a program as users have it; its file."""
    command = ["cargo", "build", "--release", "-p", package, *arguments, "--message-format=json"]
    messages = map(json.loads, run(command, cwd=ROOT, show_errors=True).splitlines())
    made = [message.get("executable") for message in messages if message.get("target", {}).get("name") == name]
    return Path(next(filter(None, made)))


def run(command, cwd=None, show_errors=False):
    """Standard output of a command that has to succeed."""
    errors = None if show_errors else subprocess.PIPE
    try:
        done = subprocess.run(
            command, cwd=cwd, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors, text=True
        )
    except OSError as error:
        sys.exit(f"{command[0]} cannot be started: {error}")
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))} failed ({done.returncode}):\n{done.stderr or ''}")
    return done.stdout


def machine():
    """The processor's name."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def load():
    """Mean number of processes that ran or wanted to, over the last minute."""
    return os.getloadavg()[0]

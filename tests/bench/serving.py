"""The conversation between `compare` and a peer's process: one line of JSON each way.

A peer says first whether it can work here: {"ready": version} or {"missing": reason}. After that every line {"scene",
"edge", "samples", "backs", "lit"} is a bake of that scene on a mesh with edges of at most `edge`, with the backs of
double-sided surfaces or without, written to `lit`, and is answered with {"seconds", "cpu_seconds", "vertices"} or
{"missing": reason}. The process stays, so that what it compiled stays too."""

import contextlib
import json
import os
import subprocess
import sys
import time


class Missing(Exception):
    """A peer cannot work here, or not on this scene; says why."""


def serve(start, bake):
    """Answers requests until there are no more. `start()` gives the version, `bake(request)` an answer; both may raise."""
    # Libraries print what they like: the answers have a channel of their own.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(message):
        print(json.dumps(message), file=answers, flush=True)

    try:
        answer({"ready": start()})
    except Exception as error:
        answer({"missing": f"{type(error).__name__}: {error}"})
        return
    for line in sys.stdin:
        try:
            answer(bake(json.loads(line)))
        except Exception as error:
            answer({"missing": f"{type(error).__name__}: {error}"})


class Clock:
    """Wall time, and the processor time of all threads."""

    def __init__(self):
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def read(self):
        return {"seconds": time.perf_counter() - self.wall, "cpu_seconds": time.process_time() - self.cpu}


class Peer:
    """A peer's process, from the other side."""

    def __init__(self, name, python, script, log):
        self.name = name
        try:
            self.process = subprocess.Popen(
                [python, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True
            )
        except OSError as error:
            raise Missing(f"{python} cannot be started: {error}") from error
        self.version = self.answer()["ready"]

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            raise Missing(f"its process ended with status {self.process.wait()}")
        message = json.loads(line)
        if "missing" in message:
            raise Missing(message["missing"])
        return message

    def bake(self, **request):
        """Asks for a bake and waits for it."""
        # A process that ended is found by what it answers: nothing.
        with contextlib.suppress(BrokenPipeError):
            print(json.dumps(request), file=self.process.stdin, flush=True)
        return self.answer()

    def has_ended(self):
        return self.process.poll() is not None

    def close(self):
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
        self.process.wait()

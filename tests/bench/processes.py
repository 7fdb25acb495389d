"""Workers as processes of one thread on one core, bakes on them, and the processor time that each of them takes."""

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass

TICKS = os.sysconf("SC_CLK_TCK")


@dataclass
class Programs:
    """What is measured."""

    coordinator: str
    worker: str

    def plain_text(self, program):
        """The argument that allows a connection without TLS to another address than the machine's own."""
        helped = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
        return ["--plaintext"] if "--plaintext" in helped else []


class Worker:
    """A worker of one thread on one core; `inside` is a command that it is started by, as in a network namespace."""

    def __init__(self, programs, core, listen="127.0.0.1:0", inside=()):
        command = [*inside, "taskset", "--cpu-list", str(core), programs.worker]
        command += ["--listen", listen, "--threads", "1", *programs.plain_text(programs.worker)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        # "worker NAME listens on ADDRESS with N threads"
        words = self.process.stdout.readline().split()
        if "on" not in words:
            self.process.kill()
            sys.exit(f"{' '.join(map(str, command))} does not listen: {self.process.stderr.read()}")
        self.address = words[words.index("on") + 1]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def cpu_seconds(self):
        """Of all its threads, user and system."""
        with open(f"/proc/{self.process.pid}/stat") as file:
            # After the name, which may have blanks and parentheses, the third field follows.
            fields = file.read().rsplit(")", 1)[1].split()
        return sum(map(int, fields[11:13])) / TICKS


@dataclass
class Run:
    """A bake."""

    workers: int
    seconds: float
    coordinator_cpu: float
    worker_cpu: list
    rows: int
    jobs: list
    bytes: int
    visible_factors: int
    busy_seconds: float

    @property
    def coordinator_part(self):
        """The coordinator's part of all processor time."""
        return self.coordinator_cpu / (self.coordinator_cpu + sum(self.worker_cpu))

    def to_json(self):
        return asdict(self) | {"coordinator_part": self.coordinator_part}


def solve(programs, scene, arguments, workers, folder, inside=()):
    """Bakes a scene on these workers, which nobody else uses meanwhile."""
    report = folder / "report.json"
    command = [*inside, programs.coordinator, "solve", scene, "-o", folder / "lit.glb", "--report", report, *arguments]
    command += ["--workers", ",".join(worker.address for worker in workers)]
    command += programs.plain_text(programs.coordinator) if inside else []
    before = [worker.cpu_seconds() for worker in workers]
    with open(folder / "coordinator.log", "w") as log:
        clock = time.perf_counter()
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - clock
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))} failed:\n{(folder / 'coordinator.log').read_text()}")
    worker_cpu = [worker.cpu_seconds() - earlier for worker, earlier in zip(workers, before)]
    figures = json.loads(report.read_text())
    total = lambda name: sum(worker[name] for worker in figures["workers"])
    return Run(
        workers=len(workers),
        seconds=seconds,
        coordinator_cpu=used.ru_utime + used.ru_stime,
        worker_cpu=worker_cpu,
        rows=total("rows"),
        jobs=[worker["jobs"] for worker in figures["workers"]],
        bytes=total("bytes_received"),
        visible_factors=figures["bake"]["visible_factors"],
        busy_seconds=total("busy_seconds"),
    )

"""A small network of its own: a coordinator and workers on a switch, each behind a port of 100 Mbit/s and 1 ms."""

import os
import shutil
import subprocess
import sys

NETEM = ["netem", "delay", "1ms", "rate", "100mbit", "limit", "10000"]
"""What each direction of each port does to packets, for `tc`."""

BUCKET = ["tbf", "rate", "100mbit", "burst", "32k", "latency", "50ms"]
"""The same without the delay, for kernels that lack netem."""


class Link:
    """Network namespaces named by this process, which nothing leads out of; gone at the end."""

    def __init__(self, workers):
        for tool in ("ip", "tc"):
            if shutil.which(tool) is None:
                sys.exit(f"{tool} is missing: install iproute2")
        if os.geteuid() != 0:
            sys.exit("network namespaces need root: run it with sudo")
        self.name = f"halflight{os.getpid()}"
        self.hosts = ["coordinator", *(f"worker{number}" for number in range(workers))]
        self.namespaces = []
        self.port = NETEM

    def __enter__(self):
        try:
            self.add(self.switch)
            ip("-n", self.switch, "link", "add", "bridge", "type", "bridge")
            ip("-n", self.switch, "link", "set", "bridge", "up")
            for number, host in enumerate(self.hosts):
                self.connect(number, host)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for namespace in reversed(self.namespaces):
            ip("netns", "delete", namespace)
        self.namespaces.clear()

    @property
    def switch(self):
        return f"{self.name}-switch"

    def add(self, namespace):
        ip("netns", "add", namespace)
        self.namespaces.append(namespace)

    def connect(self, number, host):
        namespace, port = f"{self.name}-{host}", f"port{number}"
        self.add(namespace)
        ip("-n", self.switch, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", namespace)
        ip("-n", self.switch, "link", "set", port, "master", "bridge", "up")
        ip("-n", namespace, "address", "add", f"{self.address(number)}/24", "dev", "eth0")
        ip("-n", namespace, "link", "set", "eth0", "up")
        ip("-n", namespace, "link", "set", "lo", "up")
        for side, device in ((self.switch, port), (namespace, "eth0")):
            add = ["tc", "-n", side, "qdisc", "add", "dev", device, "root"]
            if self.port is NETEM and subprocess.run([*add, *NETEM], capture_output=True).returncode != 0:
                self.port = BUCKET
            if self.port is BUCKET:
                run(*add, *BUCKET)

    @staticmethod
    def address(number):
        return f"10.77.0.{number + 1}"

    def inside(self, number):
        """The command that starts another one on a host; the coordinator is number 0."""
        return ["ip", "netns", "exec", f"{self.name}-{self.hosts[number]}"]


def ip(*arguments):
    run("ip", *arguments)


def run(*command):
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed: {done.stderr.strip()}")

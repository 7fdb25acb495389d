"""Lines of the program on standard error: progress, warnings, the error. Needs no Blender."""

import re
from dataclasses import dataclass

STEPS = {
    "queued", "import", "mesh", "light", "shoot", "refine", "measure", "final solve", "groups", "lightmap", "probes",
    "export mesh", "export",
}
ROWS = re.compile(r"\brows (\d+)/(\d+)")
LEFT = re.compile(r"(\d+) s left")
# The add-on shows the light on materials of its own, without lamps.
EXPECTED = re.compile(r"lamps? stays? in the file, and (its|their) light is in the lightmap, too")


@dataclass(frozen=True)
class Progress:
    """How far a bake is: its step, the done part of the rows known to be needed (0 to 1, may fall), and seconds left or None."""

    step: str
    part: float
    left: int | None = None

    def __str__(self):
        left = "" if self.left is None else f", {self.left} s left"
        return f"{self.step} {100 * self.part:.0f} %{left}"


def parse(line):
    """Returns the progress of a line, or None where it tells something else."""
    step, colon, rest = line.strip().partition(": ")
    if not colon or step not in STEPS:
        return None
    rows, left = ROWS.search(rest), LEFT.search(rest)
    done, needed = map(int, rows.groups()) if rows else (0, 0)
    part = min(done / needed, 1.0) if needed else 0.0
    return Progress(step, part, int(left[1]) if left and part else None)


def warnings(text):
    """Returns what the program warned of, without lines that the add-on expects."""
    lines = (line.removeprefix("warning: ") for line in text.splitlines() if line.startswith("warning: "))
    return [line for line in lines if not EXPECTED.search(line)]


def error(text):
    """Returns the error that the program ended with, or its last line that is no progress, or an empty string."""
    lines = [line for line in text.splitlines() if line.strip() and parse(line) is None]
    at = next((index for index in reversed(range(len(lines))) if lines[index].startswith("error: ")), len(lines) - 1)
    return " ".join(line.strip() for line in lines[at:]).removeprefix("error: ") if lines else ""

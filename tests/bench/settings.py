"""Which settings reach an error in the least time: of this program, and of a peer that bakes on a uniform mesh."""

import math
from dataclasses import dataclass

STEP = 0.96
"""Ratio of consecutive settings of `--error` that are tried."""

LARGEST = 0.5
"""The largest `--error` that the program takes."""

FEW, MANY = 16, 128
"""Samples at each vertex of the two bakes that tell a mesh's error from the noise."""

MOST_PATHS = 8_000_000
"""Paths of the second of them, so that the search does not take longer than what is searched for."""

FEWEST_VERTICES, MOST_VERTICES = 500, 2_000_000
"""Uniform meshes that are tried."""

MARGIN = 1.03
"""Samples beyond the estimate: a bake that misses its target has to be made again."""


def usual_settings(target):
    """From 4 down to 0.3 times the target."""
    factor = 4.0
    while factor >= 0.3:
        setting = float(f"{target * factor:.3g}")
        if setting <= LARGEST:
            yield setting
        factor *= STEP


def largest_setting(settings, target, found_error):
    """The first of some falling settings with which the found error is at most the target; None where none is. Each is
    tried: the error need not fall with the setting."""
    return next((setting for setting in settings if found_error(setting) <= target), None)


@dataclass
class Operation:
    """A peer's settings and what they give."""

    edge: float
    samples: int
    seconds: float
    error: float
    vertices: int
    estimated: bool = False
    """Not run, since it would take too long: seconds and error are what two smaller bakes let expect."""


@dataclass
class Estimate:
    """What a uniform mesh costs and gives, after two bakes: the squared error is mesh^2 + noise / samples, with the error
    `mesh` of the mesh alone, and the time grows with the samples in a straight line."""

    edge: float
    vertices: int
    mesh_squared: float
    noise: float
    base_seconds: float
    sample_seconds: float

    def operation(self, target):
        """The samples that reach the target; None where the mesh is too coarse for any."""
        if self.mesh_squared >= target**2 or self.noise <= 0:
            return None
        samples = math.ceil(MARGIN * self.noise / (target**2 - self.mesh_squared))
        seconds = self.base_seconds + samples * self.sample_seconds
        return Operation(self.edge, samples, seconds, target, self.vertices, estimated=True)


class Search:
    """The search for a peer's best settings on one scene; what is learnt for one target serves the next.

    `bake(edge, samples)` gives an Operation."""

    def __init__(self, size, bake, say):
        self.size, self.bake, self.say = size, bake, say
        self.estimates = {}

    def estimate(self, edge):
        """None where the mesh has too few vertices to be of use."""
        if edge not in self.estimates:
            few = self.bake(edge, FEW)
            if few.vertices < FEWEST_VERTICES:
                self.estimates[edge] = None
                return None
            many = self.bake(edge, max(2 * FEW, min(MANY, MOST_PATHS // few.vertices)))
            more = many.samples - FEW
            mesh = max(0.0, (many.samples * many.error**2 - FEW * few.error**2) / more)
            noise = (few.error**2 - many.error**2) / (1 / FEW - 1 / many.samples)
            slope = max(0.0, many.seconds - few.seconds) / more
            base = max(0.0, few.seconds - FEW * slope)
            self.estimates[edge] = Estimate(edge, few.vertices, mesh, noise, base, slope)
        return self.estimates[edge]

    def fastest(self, target, most_seconds):
        """The fastest settings with which the error is at most the target; None where none is. Where the fastest would
        take more than `most_seconds`, only its estimate.

        Meshes are tried from coarse to fine until they take longer; the two best by their estimates are then baked, with
        more samples until the target is met."""
        found, edge = [], self.size / 4
        while len(found) < 2 or found[-1].seconds <= 1.5 * min(each.seconds for each in found):
            edge /= math.sqrt(2)
            estimate = self.estimate(edge)
            if estimate is None:
                continue
            told = f"{estimate.vertices} vertices: {100 * math.sqrt(estimate.mesh_squared):.2f} % without noise"
            operation = estimate.operation(target)
            if operation is None:
                self.say(f"{told}, too coarse")
            else:
                self.say(f"{told}, {operation.samples} samples, {operation.seconds:.1f} s expected")
                found.append(operation)
            if estimate.vertices > MOST_VERTICES / 2:
                break
        found.sort(key=lambda each: each.seconds)
        if not found or found[0].seconds > most_seconds:
            return found[0] if found else None
        met = [self.until_met(target, each) for each in found[:2] if each.seconds <= most_seconds]
        return min(filter(None, met), key=lambda each: each.seconds, default=None)

    def until_met(self, target, operation):
        samples = operation.samples
        for _ in range(10):
            baked = self.bake(operation.edge, samples)
            self.say(
                f"{baked.vertices} vertices, {samples} samples: {100 * baked.error:.2f} %, {baked.seconds:.2f} s"
            )
            if baked.error <= target:
                return baked
            samples = math.ceil(samples * 1.05)
        return None

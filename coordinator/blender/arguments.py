"""Command lines of the program `coordinator`. Needs no Blender."""

from dataclasses import dataclass, field
from pathlib import Path

# The exporter's lighting mode that goes with it is SPEC, shown as Standard. Irradiance is then in W/m^2.
LIGHT_UNIT = "blender"


@dataclass(frozen=True)
class Sky:
    """The world around the scene: a radiance (linear RGB, W/(m^2 sr)), or an image with degrees counter-clockwise and a factor."""

    colour: tuple[float, float, float] | None = None
    image: Path | None = None
    rotation: float = 0.0
    intensity: float = 1.0


@dataclass(frozen=True)
class Bake:
    """What is baked: the quality, and light at vertices or a lightmap of at most so many pixels in width and height."""

    quality: str = "preview"
    lightmap: int | None = None
    sky: Sky = field(default_factory=Sky)


@dataclass(frozen=True)
class Service:
    """Where a service is, HOST:PORT, and how to speak to it; files are paths, empty where there are none."""

    address: str
    token_file: str = ""
    ca_file: str = ""
    plaintext: bool = False

    @property
    def is_local(self):
        """Whether it runs on this machine, so that nothing goes over a network."""
        host = self.address.rpartition(":")[0].strip("[]")
        return host in ("localhost", "::1") or host.startswith("127.")


def solve(program, scene, output, bake):
    """Returns the command that bakes a scene on this machine."""
    return [str(program), "solve", str(scene), "-o", str(output), *_options(bake, "exr")]


def submit(program, scene, output, bake, service):
    """Returns the command that has a service bake a scene, and fetches the lit one. It prints the job's id first."""
    command = [str(program), "submit", str(scene), "-o", str(output), *_options(bake, "rgbm")]
    return command + _connection(service)


def cancel(program, job, service):
    """Returns the command that cancels a job of a service."""
    return [str(program), "cancel", job, *_connection(service)]


def _options(bake, pages):
    options = ["--quality", bake.quality, "--light-unit", LIGHT_UNIT, "--only", "all", "--compress", "none"]
    if bake.lightmap:
        options += ["--lightmap", "--lightmap-size", str(bake.lightmap), "--lightmap-format", pages]
    else:
        options += ["--materials", "keep"]
    sky = bake.sky
    if sky.image:
        options += ["--sky", str(sky.image), f"--sky-rotation={number(sky.rotation)}"]
        options += ["--sky-intensity", number(sky.intensity)]
    elif sky.colour and any(sky.colour):
        options += ["--sky", ",".join(map(number, sky.colour))]
    return options


def _connection(service):
    given = [("--server", service.address), ("--token-file", service.token_file), ("--tls-ca", service.ca_file)]
    options = [part for name, value in given if value for part in (name, str(value))]
    return options + ["--plaintext"] if service.plaintext else options


def number(value):
    """Writes a number with as many digits as a single-precision float has."""
    return f"{float(value):.9g}"

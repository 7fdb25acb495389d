"""The add-on of Blender: python addon.py COORDINATOR FOLDER

Builds and installs the extension as users do, bakes a room by script, and compares its light with formulas and with Cycles' own bake.
Needs bpy (PyPI) and its numpy.
"""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parents[1] / "coordinator" / "blender"
PROGRAM, FOLDER = Path(sys.argv[1]).absolute(), Path(sys.argv[2]).absolute()
FOLDER.mkdir(parents=True, exist_ok=True)
# Before bpy: nothing is installed into the user's own Blender.
os.environ["BLENDER_USER_RESOURCES"] = str(FOLDER / "resources")

import bpy  # noqa: E402

sys.path.insert(0, str(HERE))
import addon_checks as checks  # noqa: E402
import addon_cycles as cycles  # noqa: E402
import addon_room as room  # noqa: E402


def install():
    """Builds the zip with Blender's own tool, and installs and enables it."""
    tool = Path(bpy.utils.resource_path("LOCAL")) / "scripts" / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    for command in (["validate", SOURCE], ["build", "--source-dir", SOURCE, "--output-dir", FOLDER]):
        subprocess.run([sys.executable, tool, *command], check=True, stdout=subprocess.DEVNULL)
    [archive] = FOLDER.glob("halflight-*.zip")
    bpy.ops.preferences.addon_enable(module="bl_pkg")
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True)
    preferences = bpy.context.preferences.addons["bl_ext.user_default.halflight"].preferences
    preferences.program = str(PROGRAM)
    return preferences


def main():
    subprocess.run([sys.executable, "-m", "unittest", "discover", "-s", HERE], check=True)
    preferences = install()
    print(f"Blender {bpy.app.version_string}")
    room.make()
    before = checks.snapshot()
    checks.fails_without_program(preferences)
    checks.cancels()
    checks.is_as_it_was(before)
    checks.runs_in_windows()
    checks.colours(before)
    checks.lightmap(before)
    cycles.texels()
    cycles.pictures(FOLDER)
    checks.service(preferences, PROGRAM, FOLDER)
    cycles.sky()
    preferences.where = "LOCAL"
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.halflight")


main()

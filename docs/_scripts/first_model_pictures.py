"""Pictures of the page "First model": figures that its commands write.

``python docs/_scripts/first_model_pictures.py`` writes ``docs/pictures/motor-*.svg`` again.
"""

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

PICTURES = Path(__file__).parents[1] / "pictures"

#: Commands of the page, without the name of the program.
COMMANDS = (
    "examples .",
    "fit motor.csv --input drive_V --output speed_rad_s --out motor --figures all",
)

#: Figures of the result that the page shows.
SHOWN = ("record", "free-run", "front")


def write_pictures() -> None:
    """Run the commands, and copy the figures."""
    with TemporaryDirectory() as folder:
        for command in COMMANDS:
            subprocess.run([sys.executable, "-m", "islands", *command.split()], check=True, cwd=folder)
        for name in SHOWN:
            shutil.copyfile(Path(folder) / "motor/figures" / f"{name}.svg", PICTURES / f"motor-{name}.svg")


if __name__ == "__main__":
    write_pictures()

"""Draws the pictures of the gallery: ``python -m docs.gallery FOLDER [NAME ...]``."""

import subprocess
import sys
from pathlib import Path

from tqdm import tqdm

HERE = Path(__file__).parent
SCRIPTS = sorted(p.stem for p in HERE.glob("*.py") if p.stem not in ("__main__", "models"))

folder, *names = sys.argv[1:]
for name in tqdm(names or SCRIPTS, unit="picture"):
    picture = Path(folder) / f"{name}.webp"
    subprocess.run([sys.executable, "-m", f"docs.gallery.{name}", str(picture)], check=True)

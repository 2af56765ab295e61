"""Two stub files in place of MetaDrive's assets.

MetaDrive looks for two files when it starts and downloads its assets (models, textures) where one is missing. The assets are
for pictures; without rendering nothing else of them is read. This script writes the two files that are looked for, and says so:
a version file that holds MetaDrive's version, and an empty texture. It touches nothing if real assets are there.
"""

import importlib.util
import sys
from importlib import metadata
from pathlib import Path

TEXTURE = ("textures", "grass1", "GroundGrassGreen002_COL_1K.jpg")
NOTE = (
    "This folder was made by evodrive-metadrive-stubs. It holds no assets of MetaDrive, only the two files that MetaDrive "
    "looks for before it downloads them. Delete the folder before you render.\n"
)


def assets() -> Path:
    """Where MetaDrive keeps its assets; MetaDrive itself is not imported, since that has effects."""
    found = importlib.util.find_spec("metadrive")
    if found is None or found.origin is None:
        raise FileNotFoundError("MetaDrive is not installed here; install it with `pip install metadrive-simulator==0.4.3`")
    return Path(found.origin).parent / "assets"


def are_there() -> bool:
    """Whether MetaDrive would start without a download."""
    folder = assets()
    return (folder / "version.txt").exists() and folder.joinpath(*TEXTURE).exists()


def main() -> int:
    """Writes the stubs."""
    folder = assets()
    if are_there():
        print(f"nothing to do: {folder} has what MetaDrive looks for")
        return 0
    if (folder / "version.txt").exists():
        print(f"{folder} holds assets of another version; delete it or update it with `python -m metadrive.pull_asset --update`")
        return 1
    version = metadata.version("metadrive-simulator")
    texture = folder.joinpath(*TEXTURE)
    texture.parent.mkdir(parents=True, exist_ok=True)
    if not texture.exists():
        texture.write_bytes(b"")
    (folder / "STUBS.txt").write_text(NOTE)
    (folder / "version.txt").write_text(version + "\n")
    print(f"wrote two stub files below {folder}: version.txt ({version}) and an empty {TEXTURE[-1]}; no asset was downloaded")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""maturin as the build backend, with a source distribution that builds: maturin leaves `[lib]` out of the manifest of a crate whose
root lies beside its folder, so these manifests are put back as they are in the repository."""

import gzip
import tarfile
from io import BytesIO
from pathlib import Path

import maturin
from maturin import *  # noqa: F401,F403  # every other hook

HERE = Path(__file__).resolve().parent
PUT_BACK = ["src/io/Cargo.toml", "src/conduct/Cargo.toml"]


def build_sdist(sdist_directory, config_settings=None):
    name = maturin.build_sdist(sdist_directory, config_settings)
    path = Path(sdist_directory) / name
    # In a source distribution this file lies at the root, in the repository below bridges/python.
    homes = [HERE, HERE.parents[1]] if len(HERE.parents) > 1 else [HERE]
    home = next(home for home in homes if (home / PUT_BACK[0]).exists())
    changed = {manifest: (home / manifest).read_bytes() for manifest in PUT_BACK}
    changed[Path(__file__).name] = Path(__file__).read_bytes()
    out = BytesIO()
    with tarfile.open(path) as before, tarfile.open(fileobj=out, mode="w", format=tarfile.PAX_FORMAT) as after:
        root = before.getnames()[0].split("/")[0]
        for member in before.getmembers():
            inner = member.name.removeprefix(f"{root}/")
            if inner in changed:
                continue
            after.addfile(member, before.extractfile(member) if member.isfile() else None)
        for inner, data in changed.items():
            member = tarfile.TarInfo(f"{root}/{inner}")
            member.size, member.mode = len(data), 0o644
            after.addfile(member, BytesIO(data))
    path.write_bytes(gzip.compress(out.getvalue(), mtime=0))
    return name

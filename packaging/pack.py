"""Packs a wheel from what `packaging/wheel` has built: the module, the program, and the Python files.

    python packaging/pack.py MODULE PROGRAM FOLDER

The same files give the same bytes. The wheel's name says which glibc it needs: the newest symbol version that module or program ask for.
maturin would do the same, but builds the module in an environment of its own, and all that it stands on a second time.
"""

from __future__ import annotations

import base64
import hashlib
import io
import platform
import re
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "crates" / "python"
#: The oldest glibc that has a name of its own, and the name.
OLDEST = ((2, 17), "manylinux2014")
#: A zip file has no earlier time.
WHEN = (1980, 1, 1, 0, 0, 0)


def glibc(files: list[bytes]) -> tuple[int, int]:
    """The newest glibc whose symbols are asked for."""
    found = [OLDEST[0]]
    for content in files:
        found += [(int(major), int(minor)) for major, minor in re.findall(rb"GLIBC_(\d+)\.(\d+)", content)]
    return max(found)


def tag(files: list[bytes]) -> str:
    """`manylinux_2_17_x86_64.manylinux2014_x86_64`."""
    if platform.system() != "Linux":
        sys.exit("this packs wheels for Linux: packaging/README.md has recipes for other platforms")
    machine, needed = platform.machine(), glibc(files)
    names = [f"manylinux_{needed[0]}_{needed[1]}_{machine}"]
    if needed == OLDEST[0]:
        names.append(f"{OLDEST[1]}_{machine}")
    return ".".join(names)


def metadata(version: str) -> str:
    """The core metadata of pyproject.toml."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [
        "Metadata-Version: 2.4",
        f"Name: {project['name']}",
        f"Version: {version}",
        f"Summary: {project['description']}",
        f"Keywords: {','.join(project['keywords'])}",
        f"License-Expression: {project['license']}",
        *(f"License-File: {name}" for name in project["license-files"]),
        *(f"Classifier: {name}" for name in project["classifiers"]),
        f"Requires-Python: {project['requires-python']}",
        *(f"Requires-Dist: {name}" for name in project["dependencies"]),
    ]
    for extra, names in project["optional-dependencies"].items():
        lines.append(f"Provides-Extra: {extra}")
        lines += [f'Requires-Dist: {name}; extra == "{extra}"' for name in names]
    lines.append("Description-Content-Type: text/markdown")
    return "\n".join(lines) + "\n\n" + (PACKAGE / "README.md").read_text(encoding="utf-8")


def version() -> str:
    """That of the workspace."""
    manifest = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    found: str = manifest["workspace"]["package"]["version"]
    return found


def main(module: Path, program: Path, folder: Path) -> None:
    """Writes the wheel."""
    number = version()
    binaries = [module.read_bytes(), program.read_bytes()]
    platform_tag = tag(binaries)
    info, data = f"scrnn-{number}.dist-info", f"scrnn-{number}.data"
    sources = sorted(path for path in (PACKAGE / "python" / "scrnn").iterdir() if path.suffix in (".py", ".pyi") or path.name == "py.typed")
    files: list[tuple[str, bytes, int]] = [(f"scrnn/{path.name}", path.read_bytes(), 0o644) for path in sources]
    files.append(("scrnn/_scrnn.abi3.so", binaries[0], 0o755))
    files.append((f"{data}/scripts/scrnn", binaries[1], 0o755))
    for name in ("LICENSE-MIT", "LICENSE-APACHE"):
        files.append((f"{info}/licenses/{name}", (PACKAGE / name).read_bytes(), 0o644))
    files.append((f"{info}/METADATA", metadata(number).encode(), 0o644))
    tags = "".join(f"Tag: cp310-abi3-{one}\n" for one in platform_tag.split("."))
    wheel = f"Wheel-Version: 1.0\nGenerator: packaging/pack.py\nRoot-Is-Purelib: false\n{tags}"
    files.append((f"{info}/WHEEL", wheel.encode(), 0o644))
    record = io.StringIO()
    for name, content, _ in files:
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record.write(f"{name},sha256={digest},{len(content)}\n")
    record.write(f"{info}/RECORD,,\n")
    files.append((f"{info}/RECORD", record.getvalue().encode(), 0o644))

    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("scrnn-*.whl"):
        old.unlink()
    path = folder / f"scrnn-{number}-cp310-abi3-{platform_tag}.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content, mode in files:
            entry = zipfile.ZipInfo(name, WHEN)
            entry.external_attr = (0o100000 | mode) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))

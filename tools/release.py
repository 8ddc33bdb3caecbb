"""Builds what is released and checks it: `make release`, which has its tools in .venv-release.

Into dist/: sdist and wheel (the wheel made of the sdist), an SBOM in CycloneDX of the locked
packages that a run needs, and a table of licences, vendored files included. Fails where the wheel
lacks files, a licence is not known to be compatible with Apache-2.0, or the container file has
faults.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
DIST = ROOT / "dist"
TOOLS = Path(sys.executable).parent
PYTHON = ROOT / ".venv" / "bin" / "python"

COMPATIBLE = (
    "apache", "bsd", "mit", "isc", "psf", "python software foundation", "zlib", "0bsd",
    "mpl-2.0", "mozilla public license 2.0", "unlicense", "cc0", "hpnd",
)  # fmt: skip
"""Parts of names of licences that may be used beside Apache-2.0 without conditions on our code."""
WEAK = {
    "python-can": "LGPL-3.0: imported, replaceable by its user, not changed",
    "psycopg": "LGPL-3.0: imported, replaceable by its user, not changed; optional",
    "psycopg-binary": "LGPL-3.0: imported, replaceable by its user, not changed; optional",
    "pyzmq": "BSD; its bundled libzmq is MPL-2.0",
}
"""Packages with conditions that importing them fulfils."""
VENDORED = ("stagectl/report/static", "stagectl/console/static/vendor")
NEEDED = (
    "stagectl/data/machines/", "stagectl/data/recipes/", ".eds", "stagectl/report/templates/",
    "stagectl/report/static/", "stagectl/py.typed",
)  # fmt: skip


def run(*command: object, **more: object) -> str:
    """What a command prints; it has to succeed."""
    done = subprocess.run([str(c) for c in command], cwd=ROOT, text=True, check=False,
                          stdout=subprocess.PIPE, **more)  # type: ignore[call-overload]  # fmt: skip
    if done.returncode:
        sys.exit(f"release: {' '.join(map(str, command))}: exit code {done.returncode}")
    return str(done.stdout)


def locked_packages() -> set[str]:
    """Names of the packages that a run needs."""
    lines = (ROOT / "requirements" / "run.txt").read_text(encoding="utf-8").splitlines()
    return {line.split("==")[0].lower() for line in lines if "==" in line}


def build() -> Path:
    """The wheel, made of the sdist, as an installer without wheels does."""
    DIST.mkdir(exist_ok=True)
    for old in (*DIST.glob("*.whl"), *DIST.glob("*.tar.gz")):
        old.unlink()
    code = (
        "import sys; sys.path.insert(0, 'tools'); import build_backend as b; b.build_sdist('dist')"
    )
    run(PYTHON, "-c", code)
    (sdist,) = DIST.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as name, tarfile.open(sdist) as archive:
        archive.extractall(name, filter="data")
        (source,) = Path(name).iterdir()
        run(PYTHON, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps",
            "--no-build-isolation", "--wheel-dir", DIST, source)  # fmt: skip
    (wheel,) = DIST.glob("*.whl")
    listed = run(PYTHON, "-m", "zipfile", "-l", wheel)
    missing = [part for part in NEEDED if part not in listed]
    if missing:
        sys.exit(f"release: {wheel.name} lacks {', '.join(missing)}")
    return wheel


def write_parts() -> None:
    """The SBOM of what a run needs, from the lock."""
    where = DIST / "stagectl.cdx.json"
    run(TOOLS / "cyclonedx-py", "requirements", "requirements/run.txt", "--pyproject",
        "pyproject.toml", "--output-reproducible", "--of", "JSON", "-o", where)  # fmt: skip
    parts = json.loads(where.read_text(encoding="utf-8"))["components"]
    locked = locked_packages()
    if len(parts) < len(locked):
        sys.exit(f"release: the SBOM has {len(parts)} of {len(locked)} locked packages")


def check_licences() -> None:
    """The table of licences; unknown ones and incompatible ones end the release."""
    locked = locked_packages()
    text = run(TOOLS / "pip-licenses", "--python", PYTHON, "--from=mixed", "--format=json")
    rows, wrong = ["| package | version | licence |", "| --- | --- | --- |"], []
    for entry in sorted(json.loads(text), key=lambda e: e["Name"].lower()):
        name, licence = entry["Name"].lower(), " ".join(entry["License"].split())
        if name not in locked:
            continue
        rows.append(f"| {entry['Name']} | {entry['Version']} | {licence[:80]} |")
        if name not in WEAK and not any(part in licence.lower() for part in COMPATIBLE):
            wrong.append(f"{entry['Name']}: {licence}")
    rows += [f"| {name} | | {why} |" for name, why in WEAK.items()]
    for folder in VENDORED:
        for path in sorted((ROOT / folder).glob("*LICENSE*")):
            rows.append(f"| vendored: {path.relative_to(ROOT)} | | beside it |")
    (DIST / "LICENCES.md").write_text("\n".join(rows) + "\n", encoding="utf-8")
    if wrong:
        sys.exit("release: licences to look at: " + "; ".join(wrong))


def main() -> None:
    """Build and check."""
    wheel = build()
    run(TOOLS / "check-wheel-contents", "--ignore", "W009", wheel)
    write_parts()
    check_licences()
    run(TOOLS / "hadolint", "Containerfile")
    for path in sorted(DIST.iterdir()):
        print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()

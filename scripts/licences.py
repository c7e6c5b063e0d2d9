"""Write docs/reference/licences.md: the licence of every package of every lock, by what the packages say themselves.

usage: python scripts/licences.py SITE_PACKAGES...    folders in which the packages of the locks are installed
"""

from __future__ import annotations

import re
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "licences.md"
NOT_OURS = ("dev", "docs", "uv")
"""Locks of tools that no user installs; `dev` repeats the others."""
SHORT = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD",
    "MIT License": "MIT",
    "ISC License (ISCL)": "ISC",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}
"""Trove classifier -> name."""
HEAD = """# Licences

What each package of each lock says of itself; written by `scripts/licences.py`. GOLEM is Apache-2.0. None of them is
under the GPL or the AGPL.

| package | version | licence | locks |
|---|---|---|---|
"""


def name_of(text: str) -> str:
    """Return the normal form of a package's name."""
    return re.sub(r"[-_.]+", "-", text).lower()


def locks() -> dict[str, tuple[str, list[str]]]:
    """Return version and locks of each package."""
    found: dict[str, tuple[str, list[str]]] = {}
    for path in sorted((ROOT / "requirements").glob("*.txt")):
        if path.stem in NOT_OURS:
            continue
        for name, version in re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;\\]+)", path.read_text(encoding="utf-8"), re.M):
            found.setdefault(name_of(name), (version, []))[1].append(path.stem)
    return found


def licence(package: Distribution) -> str:
    """Return what the metadata say: the expression, else the classifiers, else the first line of the text."""
    said: dict[str, list[str]] = {
        key: package.metadata.get_all(key) or [""] for key in ("License-Expression", "License", "Classifier")
    }
    expression = said["License-Expression"][0]
    trove = [c.rpartition(" :: ")[2] for c in said["Classifier"] if c.startswith("License ::")]
    names = [SHORT.get(c, c) for c in trove if c != "OSI Approved"]
    text = said["License"][0].strip()
    return expression or ", ".join(names) or (text.splitlines()[0][:60] if text else "not said")


def main() -> int:
    """Write the page; return 1 if a package is installed nowhere."""
    installed: dict[str, Distribution] = {}
    for package in distributions(path=sys.argv[1:]):
        installed.setdefault(name_of(package.metadata["Name"]), package)
    rows, absent = list[str](), list[str]()
    for name, (version, groups) in sorted(locks().items()):
        if name in installed:
            said = "core" if "core" in groups else ", ".join(dict.fromkeys(groups))
            rows.append(f"| `{name}` | {version} | {licence(installed[name])} | {said} |")
        else:
            absent.append(name)
    PAGE.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")
    print(f"{len(rows)} packages on {PAGE.relative_to(ROOT)}; not installed: {', '.join(absent) or 'none'}.")
    return bool(absent)


if __name__ == "__main__":
    raise SystemExit(main())

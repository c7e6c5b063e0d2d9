#!/usr/bin/env bash
# Builds what a release consists of into dist/: wheel, sdist, the documentation as a site, a bill of materials
# (CycloneDX) of the default environment, and checksums of all of them. The tag says the version: a checkout that is not
# exactly at the tag vVERSION of pyproject.toml is refused, unless REHEARSAL=1.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD

die() { printf 'golem: %s\n' "$*" >&2; exit 2; }
uv() { if [ -x "$root/.uv/bin/uv" ]; then "$root/.uv/bin/uv" "$@"; else command uv "$@"; fi; }
export UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1

version=$(.venv/bin/python -c 'import tomllib; print(tomllib.load(open("pyproject.toml", "rb"))["project"]["version"])')
for file in src/golem/__init__.py CITATION.cff CHANGELOG.md; do
    grep -qF "$version" "$file" || die "$file does not name the version $version of pyproject.toml."
done
if [ -z "${REHEARSAL:-}" ]; then
    [ -z "$(git status --porcelain)" ] || die "The checkout has changes; commit or stash them."
    [ "$(git describe --tags --exact-match 2> /dev/null)" = "v$version" ] ||
        die "HEAD is not tagged v$version; tag it, or type REHEARSAL=1 make release."
fi

rm -rf dist
python=$(.venv/bin/python -c 'import sys; print(sys._base_executable)')
uv build --quiet --python "$python" --out-dir dist
.venv/bin/mkdocs build --quiet --strict
tar -czf "dist/golem-docs-$version.tar.gz" --transform "s,^site,golem-docs-$version," site

empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
uv venv --quiet --python "$python" "$empty/venv"
for group in core report view; do
    uv pip install --quiet --python "$empty/venv/bin/python" --require-hashes -r "requirements/$group.txt"
done
uv pip install --quiet --python "$empty/venv/bin/python" --no-deps dist/*.whl
uv tool run --quiet --from 'cyclonedx-bom>=7.1,<8' cyclonedx-py environment "$empty/venv/bin/python" \
    --output-reproducible --output-file "dist/golem-$version.cdx.json" 2> "$empty/log" || { cat "$empty/log" >&2; exit 1; }
(cd dist && rm -f .gitignore && sha256sum -- * > SHA256SUMS && cat SHA256SUMS)

#!/usr/bin/env bash
# Checks reports, and sheets of figures (index.html), in a headless browser at 375 and 1440 pixels: run.sh REPORT.html...
# Where there is no browser, no node, or no way to their packages, it says that nothing was checked, and passes.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
skip() { echo "the browser check was not run: $1"; exit 0; }
export CHROMIUM=${CHROMIUM:-$(command -v chromium || true)}
[ -n "$CHROMIUM" ] || skip 'there is no chromium (Debian: apt-get install chromium)'
command -v node > /dev/null || skip 'there is no node'
if [ ! -d "$here/node_modules/axe-core" ] || [ ! -d "$here/node_modules/playwright-core" ]; then
  command -v npm > /dev/null || skip 'there is no npm to fetch axe-core and playwright-core with'
  npm ci --silent --no-audit --no-fund --prefix "$here" || skip 'npm could not fetch axe-core and playwright-core'
fi
check() {
  case "$1" in
    */index.html) timeout 300 node "$here/sheet.mjs" "$1" ;;
    *) timeout 300 node "$here/check.mjs" "$1" ;;
  esac
}
export -f check
export here
[ $# -gt 0 ] || exit 0
# Two at a time take two thirds of the time.
printf '%s\0' "$@" | xargs -0 -n 1 -P 2 bash -c 'check "$1"' _

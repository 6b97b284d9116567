"""The package for Debian: what lintian says, and a root of its own where it is installed, used and removed.

The root is this machine's behind an overlay, with Debian's Python alone: what is written there is gone with the test.
Folders with other installations of Python, and this checkout, are empty in it.
"""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HIDDEN = ("/root", "/home", "/work", "/usr/local", "/opt", "/tmp")  # where other packages of Python may be
FIRST_FRAME_S = 60.0
DISTRIBUTIONS = {"pyserial": "python3-serial", "pyyaml": "python3-yaml", "prompt_toolkit": "python3-prompt-toolkit"}

# The panel as a browser sees it: the page and its script, then what comes through the WebSocket first.
PAGE = """
import http.cookiejar, json, sys, urllib.request
from websockets.sync.client import connect

address = sys.argv[1]
origin = address.partition("/?")[0]
jar = http.cookiejar.CookieJar()
opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar))
print(opener.open(address).read().decode().count("<script"), len(opener.open(origin + "/static/main.js").read()) > 1000)
cookie = "; ".join(f"{c.name}={c.value}" for c in jar)
with connect(origin.replace("http", "ws") + "/ws", origin=origin, additional_headers={"Cookie": cookie}) as socket:
    print(sorted(json.loads(socket.recv()))[:1] != [])
"""

# stdin: the package. Everything that it prints is read below.
ON_THE_ROOT = r"""
set -eu
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive
cd /tmp
cat > psabench.deb
printf '%s' "$PAGE" > page.py
listing() {
    find /usr /etc /var /lib /bin /sbin -xdev ! -path '/var/lib/dpkg/*' ! -path '/var/log/*' ! -path '/var/cache/*' |
        sort
}
listing > before
echo "== install"
dpkg -i psabench.deb 2>&1
began=$(date +%s%N)
echo "== run"
psa-emu stream --can socketcand:0 --quiet > ready 2> /dev/null &
emulator=$!
for _ in $(seq 200); do grep -q 'ready all' ready && break; sleep 0.05; done
port=$(sed -n 's/.*port=//p' ready)
psabench record bus.log --can socketcand:127.0.0.1:$port --count 3 > /dev/null
psabench decode bus.log | head -n 2
echo "== first frame ms: $((($(date +%s%N) - began) / 1000000))"
kill $emulator; wait $emulator || true
psabench --version
printf 'start quiet\nhead.turn 30\n' > turn.psa
psabench run script turn.psa
echo "== panel"
psabench panel quiet --paused > panel.txt 2> panel.err &
panel=$!
for _ in $(seq 400); do grep -q '^ready' panel.txt && break; sleep 0.05; done
PYTHONPATH=/usr/lib/psabench/python python3 page.py "$(sed -n 's/^ready //p' panel.txt)" || cat panel.err
kill -INT $panel; wait $panel || true
echo "== library"
printf '%s\n' '#include <psabench.h>' '#include <stdio.h>' \
    'int main(void) { psabench *b = psabench_new(1); puts(b ? "bench" : "none"); psabench_free(b); }' > a.c
cc a.c $(pkg-config --cflags --libs psabench) -o a && ./a
PYTHONDONTWRITEBYTECODE=1 SIGROKDECODE_DIR= sigrok-cli -L | grep -c psd1cycle
man -w psabench psa-emu
echo "== extras"
python3 -c 'import matplotlib' 2> /dev/null || psabench run turns 2>&1 || true
echo "== remove"
dpkg -P psabench 2>&1
listing > after
diff before after && echo "== nothing left"
"""


def run(command: Sequence[str | Path], stdin: Path | None = None) -> str:
    env = {
        k: v
        for k, v in os.environ.items()
        if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "PYTHONPATH", "PYTHONDONTWRITEBYTECODE")
    }
    with stdin.open("rb") if stdin else open(os.devnull, "rb") as given:
        done = subprocess.run(command, cwd=ROOT, env=env, stdin=given, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def package() -> Path:
    return ROOT / run(["make", "-s", "deb"]).splitlines()[-1]


def test_lintian_says_nothing(package: Path) -> None:
    assert run(["lintian", "--fail-on", "error,warning", "--allow-root", package]) == ""


def test_each_dependency_of_the_project_is_debians_or_carried(package: Path) -> None:
    depends = re.split(r", ", run(["dpkg-deb", "-f", package, "Depends"]).strip())
    names = {d.partition(" ")[0] for d in depends}
    assert {"libc6", "libcjson1", "libfyaml0", "python3"} <= names
    files = run(["dpkg-deb", "-c", package])
    carried = set(re.findall(r"/usr/lib/psabench/python/([\w.]+?)-[\d.]+\.dist-info/METADATA", files))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for name in project["dependencies"]:
        debians = DISTRIBUTIONS.get(name, f"python3-{name}")
        assert debians in names or name.replace("-", "_") in carried, name
    assert "psabench" in carried
    assert ".so\n" not in "".join(re.findall(r".*/usr/lib/psabench/.*\n", files))


def test_it_is_installed_used_and_removed(package: Path, tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("an overlay of the root needs root")
    for part in ("upper", "root"):
        (tmp_path / part).mkdir()
    hide = "\n".join(f'[ ! -d "$root{d}" ] || mount -t tmpfs none "$root{d}"' for d in HIDDEN)
    script = f"""
set -eu
root={tmp_path}/root
mount -t tmpfs none {tmp_path}/upper
mkdir {tmp_path}/upper/u {tmp_path}/upper/w
mount -t overlay none -o lowerdir=/,upperdir={tmp_path}/upper/u,workdir={tmp_path}/upper/w "$root"
{hide}
mount --rbind /dev "$root/dev"
mount -t proc none "$root/proc"
exec chroot "$root" sh -c "$SCRIPT"
"""
    env = ["env", f"SCRIPT={ON_THE_ROOT}", f"PAGE={PAGE}"]
    said = run(
        [*env, "unshare", "--mount", "--net", "--pid", "--fork", "sh", "-c", f"ip link set lo up\n{script}"], package
    )
    parts = dict(re.findall(r"^== (\w+)[^\n]*\n((?:(?!== ).*\n)*)", said, re.MULTILINE))
    header, row = parts["run"].splitlines()[:2]
    assert header.startswith("t_rx_s,t_sample_s,x_v,y_v,z_v")
    assert row.count(",") == header.count(",")
    (ms,) = re.findall(r"^== first frame ms: (\d+)$", said, re.MULTILINE)
    assert float(ms) < FIRST_FRAME_S * 1e3
    assert re.fullmatch(r"[1-9]\d* True\nTrue\n", parts["panel"]), parts["panel"]
    assert parts["library"].splitlines()[0] == "bench"
    assert "/usr/share/man/man1/psabench.1.gz" in parts["library"]
    extra = "psabench: run: expected the extra 'reports', got none; pip install 'psabench[reports]'"
    assert parts["extras"] in ("", f"{extra}\n")
    assert said.rstrip().endswith("== nothing left")

"""A network of one's own with a route for multicast, and programs in it: python lcm_net.py, by `unshare -rn`.

Reads one JSON object a line from standard input: {"start": [argv]}, {"port": N} waits until someone listens there,
{"run": [argv]} waits for its end, {"wait": k} for that of the k-th of the started programs, {"stop": k} ends it;
{"drops": N} is how many datagrams for the port the kernel has dropped; {"publish": [URL, channel]} sends an empty
message of LCM. Writes an answer to each.
"""

import json
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import lcm

TIMEOUT_S = 60.0


def rows(port: int) -> list[list[str]]:
    """Of /proc/net/udp, for the sockets that are bound to the port; the last column counts drops."""
    lines = [line.split() for line in Path("/proc/self/net/udp").read_text().splitlines()[1:]]
    return [row for row in lines if row[1].endswith(f":{port:04X}")]


def wait_for_socket(port: int) -> bool:
    """Whether one is bound to it within the time; 2 ms between two looks."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        if rows(port):
            return True
        time.sleep(0.002)
    return False


@cache
def link_of(url: str) -> lcm.LCM:
    return lcm.LCM(url)


def publish(url: str, channel: str) -> None:
    """By a link that stays open."""
    link_of(url).publish(channel, b"")


def main() -> None:
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    subprocess.run(["ip", "route", "add", "224.0.0.0/4", "dev", "lo"], check=True)
    started: list[subprocess.Popen[str]] = []
    for line in sys.stdin:
        (word, value) = next(iter(json.loads(line).items()))
        answer: object = None
        if word == "start":
            started.append(subprocess.Popen(value, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        elif word == "port":
            answer = wait_for_socket(value)
        elif word == "drops":
            answer = sum(int(row[-1]) for row in rows(value))
        elif word == "publish":
            publish(*value)
        elif word == "run":
            done = subprocess.run(value, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
            answer = [done.returncode, done.stdout, done.stderr]
        elif word in ("stop", "wait"):
            if word == "stop":
                started[value].send_signal(signal.SIGINT)
            out, err = started[value].communicate(timeout=TIMEOUT_S)
            answer = [started[value].returncode, out, err]
        print(json.dumps(answer), flush=True)
    for program in started:
        if program.poll() is None:
            program.kill()


if __name__ == "__main__":
    main()

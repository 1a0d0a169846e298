"""Python processes with Numba already loaded, as forks of one server.

Loading Numba and compiling a first function take 0.8 seconds; a fork of a process that has done both starts
in milliseconds. The server loads no module of the project. A fork compiles, loads and saves kernels like any
other process.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

#: Script of the server. Each line of its input is a JSON request: start a process, or return its exit status
#: and output. It answers with one line.
_SERVER = """
import json, os, sys, traceback
import numba
import importlib.metadata, pathlib, platformdirs, tempfile

numba.njit(lambda x, y: x / y)(1.0, 2.0)


outputs = {}


def run(code, arguments, variables, folder):
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(variables)
    numba.config.reload_config()
    sys.argv = ["-c", *arguments]
    sys.path.insert(0, variables["PYTHONPATH"])
    try:
        exec(compile(code, "<string>", "exec"), {"__name__": "__main__"})
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def read_all(pipe):
    with os.fdopen(pipe) as file:  # the buffer of a pipe is larger than the output of a test
        return file.read()


requests = os.fdopen(os.dup(0))
for line in requests:
    request = json.loads(line)
    if "end" in request:
        pid = request["end"]
        ended, status = os.waitpid(pid, os.WNOHANG)
        result = [os.waitstatus_to_exitcode(status), *map(read_all, outputs.pop(pid))] if ended else None
        print(json.dumps(result), flush=True)
        continue
    (out, into_out), (err, into_err) = os.pipe(), os.pipe()
    pid = os.fork()
    if pid == 0:
        for number, file in ((0, os.open(os.devnull, os.O_RDONLY)), (1, into_out), (2, into_err)):
            os.dup2(file, number)
        status = run(**request)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    os.close(into_out)
    os.close(into_err)
    outputs[pid] = out, err
    print(json.dumps(pid), flush=True)
"""


class Fork:
    """Process forked by the server, with the methods of ``subprocess.Popen`` that tests use."""

    def __init__(self, ask, request):
        self._ask, self._printed = ask, ("", "")
        self.pid = ask(request)
        self.returncode = None

    def poll(self):
        if self.returncode is None:
            ended = self._ask({"end": self.pid})
            if ended is not None:
                self.returncode, *self._printed = ended
        return self.returncode

    def wait(self, timeout=120):
        end = time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired("fork", timeout)
            time.sleep(0.002)
        return self.returncode

    def kill(self):
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)

    def communicate(self, timeout=120):
        self.wait(timeout)
        return tuple(self._printed)


@contextmanager
def fork_server() -> Iterator:
    """Start a server; yield ``start(code, arguments, variables, folder)``, which forks a process."""
    server = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", _SERVER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")},
    )
    started = []

    def ask(request):
        server.stdin.write(json.dumps(request) + "\n")
        server.stdin.flush()
        return json.loads(server.stdout.readline())

    def start(code, arguments, variables, folder):
        request = {"code": code, "arguments": list(arguments), "variables": variables, "folder": str(folder)}
        started.append(Fork(ask, request))
        return started[-1]

    try:
        yield start
    finally:
        for each in started:
            each.kill()
        server.stdin.close()
        server.wait(20)
        server.stdout.close()

"""Nothing is asked at import that POSIX systems alone have. This shows that our modules load without those
names, and no more: not that they run on another system."""

import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).parents[1]
LOADING = """
import builtins, importlib, pkgutil, sys, types

OURS = ("avatargen", "assets", "exporters")
POSIX = "fcntl grp posix pty pwd resource syslog termios tty".split()
HIDDEN = {
    "os": "O_DIRECTORY O_NOFOLLOW fchmod fchown fork forkpty getegid geteuid getgid getpgid getuid killpg "
    "mkfifo nice register_at_fork sched_getaffinity setsid sysconf uname",
    "signal": "SIGALRM SIGHUP SIGKILL SIGPIPE SIGUSR1 SIGXFSZ alarm pthread_sigmask setitimer",
}


def without(name, hidden):
    module = types.ModuleType(name)
    found = sys.modules[name].__dict__.items()
    module.__dict__.update({key: value for key, value in found if key not in hidden.split()})
    return module


import os, signal
poor = {name: without(name, hidden) for name, hidden in HIDDEN.items()}
whole_import = builtins.__import__


def poor_import(name, globals=None, locals=None, fromlist=(), level=0):
    if ((globals or {}).get("__name__") or "").split(".")[0] in OURS and level == 0:
        if name in POSIX:
            raise ModuleNotFoundError(f"there is no {name} here", name=name)
        if name in poor:
            return poor[name]
    return whole_import(name, globals, locals, fromlist, level)


builtins.__import__ = poor_import
count = 0
for package in OURS:
    for found in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
        try:
            importlib.import_module(found.name)
        except ModuleNotFoundError as error:
            if error.name not in sys.argv[1:]:
                raise
        count += 1
from avatargen.threads import os as seen
assert not hasattr(seen, "fork") and hasattr(os, "fork")
print(count)
"""
OF_EXTRAS = ("anny", "triton")  # that an environment of the tests lacks


def test_every_module_loads_without_what_posix_alone_has() -> None:
    command = [sys.executable, "-c", LOADING, *OF_EXTRAS]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    files = [path for name in ("avatargen", "assets", "exporters") for path in (PROJECT / name).rglob("*.py")]
    assert int(done.stdout) == len(files) - 3  # the packages themselves

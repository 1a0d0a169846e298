"""Environments of the peers: installation once, and the message of pip."""

import sys

import pytest

from islands.benchmarks.peers.environments import prepare_environment, read_last_line
from islands.errors import SettingsError
from islands.processes.limited_command import EndedCommand
from islands.progress import StoppedError
from support.peer_scripts import make_peer


def make_run(commands, code=0, is_stopped=False):
    """Return a function that records commands, and writes the last argument to the log."""

    def run(command, log, _must_end):
        commands.append([str(part) for part in command])
        log.write_text(f"before\nERROR: {command[-1]} 3.\n\n", encoding="utf-8")
        return EndedCommand(code if "install" in command else 0, is_stopped, 0.1, 0.1)

    return run


def test_an_environment_is_installed_once(tmp_path):
    commands = []
    peer = make_peer(tmp_path, "")
    first = prepare_environment(peer, tmp_path / "new", run=make_run(commands))
    assert commands[0][:3] == [sys.executable, "-m", "venv"]
    assert commands[1][-2:] == ["install", "tiny==1.2"]
    assert commands[1][0] == commands[2][0] == str(first.python)
    assert first.packages == ("before", "ERROR:", "freeze", "3.")
    assert prepare_environment(peer, tmp_path / "new", run=make_run(commands)) == first
    assert len(commands) == 3


def test_a_failed_installation_is_an_error_and_is_repeated(tmp_path):
    peer, commands = make_peer(tmp_path, ""), []
    message = r"pip cannot install tiny==1.2 into .*: tiny==1.2 3\. .*install.log has all lines; name the"
    for _ in range(2):
        with pytest.raises(SettingsError, match=message):
            prepare_environment(peer, tmp_path, run=make_run(commands, code=1))
    assert len(commands) == 4


def test_a_stopped_installation_has_no_environment(tmp_path):
    with pytest.raises(StoppedError, match=r"install tiny==1\.2"):
        prepare_environment(make_peer(tmp_path, ""), tmp_path, run=make_run([], is_stopped=True))


def test_the_last_line_of_an_empty_log_is_no_message(tmp_path):
    (tmp_path / "log").write_text("\n \n", encoding="utf-8")
    assert read_last_line(tmp_path / "log") == "no message"

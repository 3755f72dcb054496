"""A Gmsh session leaves signals as they were, in any thread: Gmsh itself has SIGTERM end the process."""

import subprocess
import sys

import pytest

PROGRAM = """
import os, signal, threading
from geomech.shapes.gmsh_models.session import gmsh_session
signal.signal(signal.SIGTERM, signal.default_int_handler)
def use():
    with gmsh_session():
        pass
{call}
try:
    os.kill(os.getpid(), signal.SIGTERM)
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("call", ["use()", "thread = threading.Thread(target=use); thread.start(); thread.join()"])
def test_termination_is_an_interrupt_after_gmsh_too(call):
    ran = subprocess.run([sys.executable, "-c", PROGRAM.format(call=call)], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout) == (0, "interrupted\n"), ran.stderr

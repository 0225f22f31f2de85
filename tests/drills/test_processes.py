import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.drills.processes import waited_for_a_core_s
from tests.waiting import wait_until

BUSY = "while True: pass"


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="only Linux tells how long one waited")
def test_two_that_share_a_core_wait_for_it() -> None:
    core = min(os.sched_getaffinity(0))
    pair = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(2)]
    try:
        for process in pair:
            os.sched_setaffinity(process.pid, {core})
        wait_until(lambda: all(waited_for_a_core_s(process.pid) > 0.1 for process in pair))
    finally:
        for process in pair:
            process.kill()
            process.wait()

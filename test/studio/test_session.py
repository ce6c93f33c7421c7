"""What the pages of a studio share is made once."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

from tracker_node.studio.session import made_once


def test_threads_that_ask_at_once_get_the_same():
    class Desk:
        made = 0

        @made_once
        def run(self):
            self.made += 1
            time.sleep(0.05)
            return object()

    desk, together = Desk(), threading.Barrier(8)
    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda _: (together.wait(), desk.run)[1], range(8)))
    assert desk.made == 1 and all(item is found[0] for item in found)
    assert Desk().run is not desk.run

"""One thread: these tests are run beside others."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

"""Two workers share two cores: a thread pool of linear algebra in each of them would fight."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

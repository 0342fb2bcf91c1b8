"""The queue side of the service: job records, event streams, stored files and Celery tasks."""

import os

# Numerical libraries read these once, when they are loaded; several workers share the cores better so.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

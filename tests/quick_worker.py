"""``celery``, for a worker that is ready soon: it vectorizes a smaller picture to load the engine.

That loads as much; what it might not compile is in the library of kernels.
"""

from __future__ import annotations

from celery.__main__ import main

from gcvec import warm_up

if __name__ == "__main__":
    warm_up._SIDE = 64
    main()

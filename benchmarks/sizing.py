"""What one job costs a worker: ``python -m benchmarks.sizing [MEGAPIXELS ...]``.

Everything that a worker does with an upload, from its bytes to those of all files, in a process of its own,
on photos that scikit-image ships, enlarged or reduced to the size asked for. Processor time is counted, not
time on the clock, so that other programs on the machine matter little.
"""

from __future__ import annotations

import io
import json
import resource
import subprocess
import sys
import time
from dataclasses import asdict

from PIL import Image

from benchmarks.pictures import picture
from gcvec import Options
from gcvec.warm_up import warm_up
from worker.produce import produce
from worker.settings import Settings

PICTURES = ("astronaut", "coffee")
MEGAPIXELS = (0.1, 0.25, 0.5, 1.0)


def photo(name: str, megapixels: float) -> bytes:
    """A PNG of about so many million pixels."""
    buffer = io.BytesIO()
    Image.fromarray(picture(name, megapixels)).save(buffer, "PNG")
    return buffer.getvalue()


def cost(name: str, megapixels: float) -> dict[str, float]:
    """Processor seconds, and bytes held at most beyond those of an idle worker, for one job of one thread."""
    warm_up()
    image = photo(name, megapixels)
    request = {"image_name": None, "picture_name": None, "options": asdict(Options(workers=1))}
    idle = _peak()
    begun = time.process_time()
    product = produce(image, None, request, Settings(), lambda _: None)
    seconds = time.process_time() - begun
    stored = sum(map(len, product.artifacts.values()))
    return {"seconds": seconds, "idle": idle, "more": _peak() - idle, "stored": stored}


def _peak() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(cost(sys.argv[2], float(sys.argv[3]))))
        return
    print("picture     megapixels  seconds  jobs/hour/core  MB idle  MB more  MB more/megapixel  MB stored")
    for megapixels in map(float, sys.argv[1:] or MEGAPIXELS):
        for name in PICTURES:
            command = [sys.executable, "-m", "benchmarks.sizing", "--one", name, str(megapixels)]
            found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            seconds, idle, more, stored = (found[key] for key in ("seconds", "idle", "more", "stored"))
            print(
                f"{name:11} {megapixels:10.2f} {seconds:8.1f} {3600 / seconds:15.0f} {idle / 1e6:8.0f} "
                f"{more / 1e6:8.0f} {more / 1e6 / megapixels:17.0f} {stored / 1e6:10.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()

"""The whole service, once: start it, send it the sample photo, save and show what comes back.

    python -m examples.demo [OUTPUT_FOLDER]

Starts API, worker and a private broker on a free port, with their data in a temporary folder; uploads the
photo with its regions over HTTP; writes all that the service has made to `demo-out/`; stops it again.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

GCVEC = (sys.executable, "-m", "gcvec.cli")
ANNOTATIONS = Path(__file__).parent / "sample" / "chelsea.xml"

UNLIMITED = ("--max-points", "0")
"""Fur is texture: its region needs more control points than the default lets one region have."""

SECONDS_TO_START, SECONDS_TO_STOP = 60, 30


def main() -> int:
    """Run the demo; return the exit code of the process."""
    output = Path(sys.argv[1] if len(sys.argv) > 1 else "demo-out")
    with tempfile.TemporaryDirectory(prefix="gcvec-demo-") as folder, serving(Path(folder)) as url:
        print(f"service ready at {url}", flush=True)
        with as_file(files("skimage") / "data" / "chelsea.png") as photo:
            submit = (*GCVEC, "submit", str(photo), "-a", str(ANNOTATIONS), *UNLIMITED)
            submitted = subprocess.run((*submit, "--url", url, "-o", str(output)))
    if submitted.returncode:
        return submitted.returncode
    print(f"\n{table(json.loads((output / 'report.json').read_text()))}\n\n{output}/")
    for file in sorted(output.iterdir()):
        print(f"  {file.name:<14}{file.stat().st_size / 1000:>8.1f} KB")
    return 0


@contextmanager
def serving(folder: Path) -> Iterator[str]:
    """Run `gcvec serve` with its data in `folder`; give its address once it is ready, stop it at the end."""
    log = folder / "serve.log"
    with log.open("wb") as file:
        command = (*GCVEC, "serve", "--port", "0", "--data", str(folder / "data"))
        service = subprocess.Popen(command, stdout=file, stderr=file, start_new_session=True)
    try:
        yield announced(service, log)
    finally:
        service.terminate()
        try:
            service.wait(SECONDS_TO_STOP)
        except subprocess.TimeoutExpired:
            service.kill()
            service.wait()


def announced(service: subprocess.Popen[bytes], log: Path) -> str:
    """Wait for the address a service prints once it is ready.

    Raises RuntimeError, with the service's own words, when it ends or takes too long.
    """
    deadline = time.monotonic() + SECONDS_TO_START
    while time.monotonic() < deadline and service.poll() is None:
        if ready := re.search(r"^gcvec serves (\S+)$", log.read_text(errors="replace"), re.MULTILINE):
            return ready[1]
        time.sleep(0.05)
    raise RuntimeError(f"the service did not start:\n{log.read_text(errors='replace')}")


def table(report: dict[str, Any]) -> str:
    """The figures the paper tabulates for each picture."""
    seconds = report["seconds"]
    rows = {
        "resolution": "{width} x {height}".format(**report["image"]),
        "patches": report["patches"],
        "added points": report["points"],
        "average error": f"{report['mae']:.2f}",
        "MSE": f"{report['mse']:.2f}",
        "size, KB": f"{report['bytes'] / 1000:.1f}",
        "mesh and harmonic coordinates, s": f"{seconds['mesh_harmonic']:.2f}",
        "evaluation, s": f"{seconds['evaluation']:.2f}",
        "optimisation, s": f"{seconds['optimization']:.2f}",
        "total, s": f"{seconds['total']:.2f}",
    }
    return "\n".join(f"{name:<34}{value:>12}" for name, value in rows.items())


if __name__ == "__main__":
    sys.exit(main())

"""`python -m benchmarks`: measure everything, print it and write docs/benchmarks.md.

    python -m benchmarks [--quick] [--output FILE] [--minutes 20] [--megapixels 12]

Takes up to 20 minutes on two cores; `--quick` only shows in seconds that everything works.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.plan import FULL, QUICK, up_to
from benchmarks.report import document
from benchmarks.run import Run

OUTPUT = Path(__file__).parents[1] / "docs" / "benchmarks.md"


def main() -> None:
    parser = argparse.ArgumentParser(prog="benchmarks", description="Measure gcvec.")
    parser.add_argument("--quick", action="store_true", help="tiny pictures, to see that everything works")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="where the tables go")
    parser.add_argument("--minutes", type=float, default=20, help="begin nothing after so many (20)")
    parser.add_argument("--megapixels", type=float, default=12, help="largest picture (12)")
    chosen = parser.parse_args()
    plan = QUICK if chosen.quick else up_to(chosen.megapixels, FULL)
    text = document(plan, Run(seconds=60 * chosen.minutes))
    print(text)
    chosen.output.write_text(text)


if __name__ == "__main__":
    main()

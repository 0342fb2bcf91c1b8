"""`python -m gcvec.cli`, the same as `gcvec`."""

from gcvec.cli import main

main()

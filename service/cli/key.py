"""`gcvec key`: a new API key."""

from __future__ import annotations

import hashlib
import secrets

import click


@click.command()
def key() -> None:
    """Make an API key: the key itself for its user, and the digest of it for GCVEC_API_KEYS."""
    made = f"gcvec_{secrets.token_urlsafe(32)}"
    print(f"key:    {made}")
    print(f"digest: sha256:{hashlib.sha256(made.encode()).hexdigest()}")

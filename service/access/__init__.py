"""Who may call, how often, and what browsers may do with the answers."""

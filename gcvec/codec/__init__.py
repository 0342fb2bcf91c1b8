"""The `.gcv` file: what is stored, in which steps, and the coders that make bytes of it."""
